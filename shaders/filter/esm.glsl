// Exponential shadow maps (Annen et al. 2008). e^(c (z - 1)) is stored, which does not overflow.
uniform float filter_c;

vec4 filter_contents(float depth) { return vec4(exp(filter_c * (clamp(depth, 0.0, 1.0) - 1.0)), 0.0, 0.0, 0.0); }

float filter_visibility(ShadowCoord p) {
    return clamp(contents_at(p, vec2(0.0)).x * exp(filter_c * (1.0 - clamp(p.linear, 0.0, 1.0))), 0.0, 1.0);
}
