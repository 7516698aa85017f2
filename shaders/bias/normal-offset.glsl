// Moves the receiver off its surface by the filter radius (Holbert 2011), which is also the largest distance by which a
// stored depth of the same surface can be in front of it.
#include "shading_normal.glsl"
uniform float bias_scale;
uniform float bias_ulps;

vec3 bias_offset(ShadowCoord p, float reach) {
#if defined(BIAS_FALLOFF_SINE)
    return p.receiver.normal * (reach * sin_slope(p));
#elif defined(BIAS_FALLOFF_VERSINE)
    return p.receiver.normal * reach * (1.0 - p.receiver.cosine);
#elif defined(BIAS_FALLOFF_ACROSS)
    vec3 across = p.receiver.normal - p.receiver.to_light * p.receiver.cosine;
    return across * reach * (1.0 - p.receiver.cosine);
#else
    return p.receiver.normal * reach;
#endif
}

ShadowCoord bias(ShadowCoord p) {
    ShadowCoord along = p;
#ifdef BIAS_NORMAL_SHADING
    along.receiver.normal = shading_normal(p.receiver);
    along.receiver.cosine = dot(along.receiver.normal, p.receiver.to_light);
#endif
    p = moved(p, bias_offset(along, bias_scale * radius(p) * length(p.texel)));
    p.bias += bias_ulps * resolution(p);
    return p;
}
