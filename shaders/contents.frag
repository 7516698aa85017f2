// Writes what the filter stores in the map besides depth. FAR: what it stores where there is no caster.
#include "shadow_map.glsl"
#ifdef FAR
const float linear_depth = 1.0;
#else
in float linear_depth;  // see casters.vert
#endif
out vec4 contents;

void main() { contents = filter_contents(linear_depth); }
