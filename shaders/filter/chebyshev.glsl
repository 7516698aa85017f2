// Chebyshev's inequality for the share of depths of at least z, in a distribution with these two moments.
float chebyshev_upper_bound(vec2 moments, float z, float min_variance) {
    float variance = max(moments.y - moments.x * moments.x, min_variance);
    float behind = z - moments.x;
    return behind <= 0.0 ? 1.0 : variance / (variance + behind * behind);
}

// Light bleeding reduction (Lauritzen 2007): bounds below `bleed` are shadow, the rest is stretched to [0, 1].
float less_bleeding(float bound, float bleed) { return clamp((bound - bleed) / (1.0 - bleed), 0.0, 1.0); }

// Squared change of a caster's depth from one texel to the next; at silhouettes derivatives are of the same triangle, and
// for one seen edge-on they are limited.
float depth_variance(float depth) {
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
    return min(dot(slope, slope), 0.04);
}
