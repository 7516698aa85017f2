// DPCF (Myers, "Shadow of Cold War"; Filament, surface_shadowing.fs): taps once, and contact hardening of their mean.
#include "filter/blockers.glsl"
#include "filter/depth-ratio.glsl"
uniform float filter_bulb;

// The shadowed share of taps over a narrow disc, from that over the wide one: a stronger smoothstep.
float hardened_kernel(float share) {
    float s = 2.0 * share - 1.0, rest = 1.0 - abs(s);
    return 0.5 + 0.5 * sign(s) * (1.0 - rest * rest * rest);
}

float filter_visibility(ShadowCoord p) {
    float radius = max(filter_bulb, 0.5 * length(p.texel));
    vec2 found = blockers(p, texels_across(p), radius, turn(), FILTER_TAPS);
    if (found.y == 0.0) return 1.0;
    float penumbra_ratio = clamp(depth_ratio(p, found.x), 0.0, 1.0);
    return 1.0 - mix(hardened_kernel(found.y), found.y, penumbra_ratio);
}
