"""The techniques: one file each, and the rows (biases, filters, fits) that map techniques share."""
