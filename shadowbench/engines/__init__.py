"""Scoring other renderers: export a view as glTF and matrices, score the mask or screenshots. Needs no GL."""
