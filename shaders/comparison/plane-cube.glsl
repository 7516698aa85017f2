// Each texel of a cube map is compared with the receiver's plane in its direction.
#include "plane/cube.glsl"

float compare_nearest(ShadowCoord p, vec2 offset) {
    return plane_depth(p, offset) <= nearest_depth(p, offset) ? 1.0 : 0.0;
}

float compare_linear(ShadowCoord p, vec2 offset) { return hardware_comparison(p, offset, plane_depth(p, offset)); }
