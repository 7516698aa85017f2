// The depth change of the receiver's plane over the filter radius: a length along the light's axis, up to a limit,
// converted to stored depth by its derivative there. The limit is doubled for spot and point lights, which light flat
// ground at every angle. At grazing light, where the limit would leave acne on flat ground, the receiver is moved off
// its surface by the filter radius instead (Holbert 2011), which suffices for any slope. Not at steeper light: there it
// would detach contact shadows on curved ground.
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
