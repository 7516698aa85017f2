"""Anyone's pictures: export a view as glTF and matrices, score a mask or screenshots of it. Needs no GL."""
