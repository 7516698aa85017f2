#include "plane/matrix.glsl"

// A spot's depth is affine in 1/w, w being the distance along the axis, and so is that of a plane over the map.
float plane_depth(ShadowCoord p, vec2 offset) {
    float change = depth_sign * dot(p.gradient, offset) / map_size;
    if (light.w == 0.0) return p.linear + change;
    float w = 1.0 / max(1.0 / p.axis_distance - change / depth_scale[p.layer], 1e-3 / p.axis_distance);
    return p.linear + (w - p.axis_distance) * p.linear_per_length;
}
