"""Anyone's engine: a view out, as glTF and matrices; a mask or screenshots back in, scored. Needs no GL."""
