// Metres; (b - z)/z of reversed depths, and a factor by the texel's width in metres: shadow_sampling.wgsl.
#include "filter/pcss/engine.glsl"
#include "filter/pcss/unlightened.glsl"

float search_radius(ShadowCoord p) { return size_or(10.0) * metre; }
float penumbra_estimate(ShadowCoord p, float gap) {
    float blur = max(size_or(10.0) * gap * p.linear_per_length / max(1.0 - p.linear, 1e-4), 0.5);
    float fudge = 0.015 + (map_side(p) / map_size / metre - 0.00390625) * 0.02 / (0.022949219 - 0.00390625);
    return fudge * blur * metre;
}
