// What the surface's slope makes of the filter's reach: the depth that a plane of angle θ gains over radius texels,
// as a length along the ray, turned into depth by its derivative there.
#define BIAS_HAS_DEPTH
uniform float bias_scale;
uniform float bias_limit;
uniform float bias_ulps;

float bias_depth(Receiver r, MapPoint p) {
    float reach = bias_scale * filter_radius * min(length(p.texel) * tan_theta(r), bias_limit * max(p.texel.x, p.texel.y));
    return reach * p.depth_per_length + bias_ulps * depth_step;
}
