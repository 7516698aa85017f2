// Exponential variance shadow maps (Lauritzen and McCool 2008): two moments of each warp of depth.
#include "filter/chebyshev.glsl"
uniform float filter_positive;
uniform float filter_negative;
uniform float filter_bleed;
uniform float filter_min_variance;

// The square of a larger warp exceeds the largest half float.
#if FILTER_BITS == 16
const float most = 5.54;
#else
const float most = 42.0;
#endif
#define EXPONENTS min(vec2(filter_positive, filter_negative), most)

// e^(c⁺(2z − 1)) and −e^(−c⁻(2z − 1)), of depths from 0 to 1.
vec2 warped(float depth) {
    float z = 2.0 * clamp(depth, 0.0, 1.0) - 1.0;
    vec2 c = EXPONENTS;
    return vec2(exp(c.x * z), -exp(-c.y * z));
}

vec4 filter_contents(float depth) {
    vec2 w = warped(depth);
    return vec4(w.x, w.x * w.x, w.y, w.y * w.y);
}

float filter_visibility(ShadowCoord p) {
    vec2 w = warped(p.linear);
    // A depth changes a warp by its derivative, 2 c |w|.
    vec2 scale = 2.0 * EXPONENTS * w;
    vec2 least = filter_min_variance * scale * scale;
    vec4 stored = contents_at(p, vec2(0.0));
    float bound = chebyshev_upper_bound(stored.xy, w.x, least.x);
#if FILTER_COMPONENTS == 4
    bound = min(bound, chebyshev_upper_bound(stored.zw, w.y, least.y));
#endif
    return less_bleeding(bound, filter_bleed);
}
