// Variance shadow maps (Donnelly and Lauritzen 2006).
#include "filter/chebyshev.glsl"
uniform float filter_bleed;
uniform float filter_min_variance;

// The variance of depth within a texel, of which the derivatives give a quarter (Lauritzen 2007), is part of the moment.
vec4 filter_contents(float depth) {
    float z = clamp(depth, 0.0, 1.0);
    return vec4(z, z * z + 0.25 * depth_variance(depth), 0.0, 0.0);
}

float filter_visibility(ShadowCoord p) {
    float z = clamp(p.linear, 0.0, 1.0);
    return less_bleeding(chebyshev_upper_bound(contents_at(p, vec2(0.0)).xy, z, filter_min_variance), filter_bleed);
}
