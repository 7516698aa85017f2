"""Shadow techniques, one file each, and the biases, filters, fits and splits that shadow-map techniques share."""
