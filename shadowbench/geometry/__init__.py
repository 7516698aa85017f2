"""What techniques and needs both compute of a scene: light views, slices, planes, topology. No GL."""
