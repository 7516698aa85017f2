// The depth change of the receiver's plane over the filter radius: a length along the light's axis, up to a limit,
// converted to stored depth by its derivative there. The limit is doubled for spot and point lights, which light flat
// ground at every angle. At grazing light, where the limit would leave acne on flat ground, the receiver is moved off
// its surface by the filter radius instead (Holbert 2011), which suffices for any slope. Not at steeper light: there it
// would detach contact shadows on curved ground.
uniform float bias_scale;
uniform float bias_limit;
uniform float bias_grazing;
uniform float bias_ulps;

ShadowCoord bias(ShadowCoord p) {
    float reach = bias_scale * radius(p), diagonal = length(p.texel), steep = tan_slope(p);
    float most = bias_limit * (1.0 + light.w) * max(p.texel.x, p.texel.y);
    float along = steep < bias_grazing ? reach * min(diagonal * steep, most) : 0.0;
    float off = steep < bias_grazing ? 0.0 : reach * diagonal * sin_slope(p);
    p = moved(p, p.receiver.normal * off);  // by nothing too: a branch would take longer
    p.bias += along * p.depth_per_length + bias_ulps * resolution(p);
    return p;
}
