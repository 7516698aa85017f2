// Moves the receiver off its surface by the filter radius (Holbert 2011), which is also the largest distance by which a
// stored depth of the same surface can be in front of it.
#include "bias/normal/<bias_normal>.glsl"
#include "bias/falloff/<bias_falloff>.glsl"
uniform float bias_scale;
uniform float bias_ulps;

ShadowCoord bias(ShadowCoord p) {
    p = moved(p, bias_offset(with_bias_normal(p), bias_scale * radius(p) * length(p.texel)));
    p.bias += bias_ulps * resolution(p);
    return p;
}
