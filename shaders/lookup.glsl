// Visibility of a receiver by one layer of 2-D maps, with the chosen bias and filter.
#include "map.glsl"
#include "bias.glsl"
#include "compare.glsl"
#include <filter>

// To be called by every pixel of a quad: a bias may take screen derivatives.
float map_visibility(Receiver r, int layer) {
    MapPoint p = map_point(r.position, layer);
    p = map_point(r.position + bias_move(r, p), layer);
    // Casters in front of near are stored at near itself; a bias larger than the receiver's depth would see past them.
    float room = REVERSED == 1 ? 1.0 - p.depth : p.depth;
    p.bias = min(bias_depth(r, p), max(room - depth_step, 0.0));
    p.gradient = bias_gradient(r, p);
    if (!r.facing || p.axis_distance <= 0.0) return 1.0;
    float beyond = REVERSED == 1 ? -p.depth : p.depth - 1.0;
#ifdef FAR_RULE_LIT
    if (beyond > 0.0) return 1.0;
#else
    // Fixed-point maps clamp the compared depth; said here, so that all formats agree.
    if (beyond - p.bias > 0.0) return 0.0;
#endif
    return filtered(p);
}
