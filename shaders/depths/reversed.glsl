// Depth is 1 at the near plane and 0 at the far plane.
const float depth_sign = -1.0;

float from_near(float depth) { return 1.0 - depth; }
float stored_range(float depth, float front) { return clamp(depth, 0.0, 1.0 - front); }
