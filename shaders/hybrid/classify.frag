// Visibility where a 2-D map is certain; elsewhere the reach of a ray, and a depth that lets the next pass draw there.
#include "shadow_map.glsl"
layout(location = 0) out float visibility;
layout(location = 1) out float reach;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    visibility = map_visibility(r, 0);
    reach = -visibility / max(dot(r.to_light, light_axis), 1e-3);
    gl_FragDepth = visibility < 0.0 ? 1.0 : 0.0;
}
