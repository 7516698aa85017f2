"""Ray-traced ground truth by Embree, in float64 wherever float32 would move a shadow. Needs no GL."""
