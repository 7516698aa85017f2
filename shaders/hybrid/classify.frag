// Visibility where a map is certain, else ½, and there a depth that lets the next pass draw.
#include "shadow_map.glsl"
out float visibility;

void main() {
    visibility = lit(bias(shadow_coord(receiver_here(), 0)));
    gl_FragDepth = visibility == 0.5 ? 1.0 : 0.0;
}
