// What the filter stores where there is no caster.
#include "shadow_map.glsl"
out vec4 contents;

void main() { contents = filter_contents(1.0); }
