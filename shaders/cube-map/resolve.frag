// Visibility of every pixel from a cube map of distances.
#include "cube_map.glsl"
out float visibility;

void main() { visibility = map_visibility(receiver_here()); }
