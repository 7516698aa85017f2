// Visibility of every pixel from one 2-D depth map (Williams 1978).
#include "shadow_map.glsl"
out float visibility;

void main() { visibility = map_visibility(receiver_here(), 0); }
