// What the surface's slope makes of the filter's reach: the depth that its plane gains over radius texels, as a length
// along the light's axis, turned into stored depth by its derivative there, up to a limit: twice as much under a lamp,
// where flat ground is met at every slant. At grazing light, where the limit would leave acne on flat ground, the
// receiver moves off its surface by the reach instead (Holbert 2011): far enough for any slope. Not before: on curved
// ground that costs contact.
#define BIAS_HAS_OFFSET
#define BIAS_HAS_DEPTH
uniform float bias_scale;
uniform float bias_limit;
uniform float bias_grazing;
uniform float bias_ulps;

vec3 bias_offset(Receiver r, ShadowCoord p) {
    if (tan_slope(r, p) < bias_grazing) return vec3(0.0);
    return r.normal * (bias_scale * p.radius * length(p.texel) * sin_slope(r, p));
}

float bias_depth(Receiver r, ShadowCoord p) {
    float steep = tan_slope(r, p);
    float most = bias_limit * (1.0 + light.w) * max(p.texel.x, p.texel.y);
    float reach = bias_scale * p.radius * min(length(p.texel) * steep, most);
    return (steep < bias_grazing ? reach : 0.0) * p.depth_per_length + bias_ulps * p.step;
}
