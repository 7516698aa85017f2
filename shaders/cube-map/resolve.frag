// Visibility of every pixel from a cube map of distances.
#include "cube_map.glsl"
#include "bias.glsl"
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    ShadowCoord p = shadow_coord(r.position);
    p = shadow_coord(r.position + bias_offset(r, p));
    p.normal = r.normal;
    p.bias = bias_depth(r, p);
    p.linear = p.depth - p.bias;
    visibility = r.facing ? filter_visibility(p) : 1.0;
}
