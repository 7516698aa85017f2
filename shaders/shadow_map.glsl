// Shadow mapping (Williams 1978) with percentage-closer filtering (Reeves, Salesin and Cook 1987): visibility is
// lit(bias(receiver)), of the receiver's point in the map. Names in <> are chosen where the shader is composed.
#include "map.glsl"
#include "depths/<depths>.glsl"
#include "far_rule/<far_rule>.glsl"
#include "bias.glsl"
#include "gradient/<gradient>.glsl"
#include "filter.glsl"

// Visibility of a biased receiver. All pixels of a quad must have called `bias` before, as it may take screen derivatives.
float lit(ShadowCoord p) {
    if (!p.receiver.facing || p.axis_distance <= 0.0) return 1.0;
    // Casters in front of the near plane are stored at near; a bias larger than the receiver's depth would miss them.
    if (has_near_plane) p.bias = min(p.bias, max(from_near(p.depth) - depth_step, 0.0));
    if (beyond(p)) return visibility_beyond;
    p.linear -= p.bias / p.depth_per_length * p.linear_per_length;
    return filter_visibility(with_gradient(p));
}
