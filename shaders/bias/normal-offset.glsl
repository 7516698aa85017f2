// Moves the receiver off its surface by the filter radius (Holbert 2011), which is also the largest distance by which a
// stored depth of the same surface can be in front of it.
#define BIAS_HAS_OFFSET
#define BIAS_HAS_DEPTH
uniform float bias_scale;
uniform float bias_ulps;

vec3 bias_offset(Receiver r, ShadowCoord p) {
    float reach = bias_scale * p.radius * length(p.texel);
#if defined(BIAS_FALLOFF_NONE)
    return r.normal * reach;
#elif defined(BIAS_FALLOFF_VERSINE)
    return r.normal * reach * (1.0 - r.cosine);
#elif defined(BIAS_FALLOFF_ACROSS)
    return (r.normal - r.to_light * r.cosine) * reach * (1.0 - r.cosine);
#else
    return r.normal * (reach * sin_slope(r, p));
#endif
}

float bias_depth(Receiver r, ShadowCoord p) { return bias_ulps * p.step; }
