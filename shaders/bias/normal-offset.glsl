// Moves the receiver off its surface by the filter radius (Holbert 2011), which is also the largest distance by which a
// stored depth of the same surface can be in front of it.
#define BIAS_HAS_OFFSET
#define BIAS_HAS_DEPTH
uniform float bias_scale;
uniform float bias_ulps;

vec3 bias_offset(Receiver r, ShadowCoord p) {
    return r.normal * (bias_scale * p.radius * length(p.texel) * sin_slope(r, p));
}

float bias_depth(Receiver r, ShadowCoord p) { return bias_ulps * p.step; }
