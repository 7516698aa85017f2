// Visibility where a cube map is certain, else ½, and there a depth that lets the next pass draw.
#include "cube_map.glsl"
out float visibility;

void main() {
    visibility = map_visibility(receiver_here());
    gl_FragDepth = visibility == 0.5 ? 1.0 : 0.0;
}
