#include "plane/matrix.glsl"

float plane_depth(ShadowCoord p, vec2 offset) { return p.linear + depth_sign * dot(p.gradient, offset) / map_size; }
