"""What is right: visibility by Embree, in float64 wherever a float32 would move a shadow. Knows no GL."""
