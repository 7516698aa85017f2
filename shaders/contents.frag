// Writes what the filter stores in the map besides depth.
#include "shadow_map.glsl"
in float linear_depth;  // see casters.vert
out vec4 contents;

void main() { contents = filter_contents(linear_depth); }
