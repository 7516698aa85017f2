"""What map techniques share: fits, casters, biases, filters, stored contents and the resolve pass."""
