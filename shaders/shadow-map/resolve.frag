// Visibility of every pixel from one map.
#include "shadow_map.glsl"
out float visibility;

void main() {
    ShadowCoord receiver = shadow_coord(receiver_here(), 0);
    visibility = lit(bias(receiver));
}
