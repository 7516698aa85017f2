// Visibility of every pixel from a cube map of distances.
#include "cube_map.glsl"
#include "bias.glsl"
uniform vec3 eye;
uniform float view_far;
#include <filter>
#ifndef FILTER_HAS_REACH
float filter_reach(ShadowCoord p) { return filter_radius; }
#endif
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    ShadowCoord p = shadow_coord(r.position);
    p = shadow_coord(r.position + bias_offset(r, p));
    p.bias = bias_depth(r, p);
    visibility = r.facing ? filter_visibility(p) : 1.0;
}
