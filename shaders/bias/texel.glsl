// What the surface's slope makes of the filter's reach: the depth that its plane gains over radius texels, as a length
// along the light's axis, turned into stored depth by its derivative there.
#define BIAS_HAS_DEPTH
uniform float bias_scale;
uniform float bias_limit;
uniform float bias_ulps;

float bias_depth(Receiver r, MapPoint p) {
    float reach = bias_scale * p.radius * min(length(p.texel) * tan_slope(r, p), bias_limit * max(p.texel.x, p.texel.y));
    return reach * p.depth_per_length + bias_ulps * p.step;
}
