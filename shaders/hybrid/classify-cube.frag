// Visibility where a cube map is certain; elsewhere the reach of a ray, and a depth that lets the next pass draw there.
#include "cube_map.glsl"
layout(location = 0) out float visibility;
layout(location = 1) out float reach;

void main() {
    visibility = map_visibility(receiver_at(ivec2(gl_FragCoord.xy)));
    reach = -visibility;
    gl_FragDepth = visibility < 0.0 ? 1.0 : 0.0;
}
