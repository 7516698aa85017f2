#include "gradient/plane.glsl"

vec2 bias_gradient(ShadowCoord p) { return plane_gradient(p); }
