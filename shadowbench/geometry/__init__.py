"""Scene geometry that techniques and the survey share: light views, frustum slices, planes, topology. No GL."""
