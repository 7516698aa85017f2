// Depth is 0 at the near plane and 1 at the far plane.
const float depth_sign = 1.0;

float from_near(float depth) { return depth; }
float stored_range(float depth, float front) { return clamp(depth, front, 1.0); }
