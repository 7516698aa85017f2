// Visibility of every pixel by one 2-D depth map (Williams 1978).
#include "map_2d.glsl"
#include "bias.glsl"
#include "compare_2d.glsl"
#include <filter>
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    MapPoint p = map_point(r.position);
    p = map_point(r.position + bias_move(r, p.texel));
    // Casters in front of near are stored at near itself; a bias larger than the receiver's depth would see past them.
    float room = REVERSED == 1 ? 1.0 - p.depth : p.depth;
    p.bias = min(bias_depth(r, p), max(room - depth_step, 0.0));
    p.gradient = bias_gradient(r, p);  // before any branch: screen derivatives need all four pixels of a quad
    visibility = 1.0;
    if (!r.facing || p.axis_distance <= 0.0) return;
    float beyond = REVERSED == 1 ? -p.depth : p.depth - 1.0;
#ifdef FAR_RULE_LIT
    if (beyond > 0.0) return;
#else
    // Fixed-point maps clamp the compared depth; said here, so that all formats agree.
    if (beyond - p.bias > 0.0) { visibility = 0.0; return; }
#endif
    visibility = filtered(p);
}
