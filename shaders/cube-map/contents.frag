// Distance to the light, linear in [0, 1], and what the filter stores besides. FAR: where there is no caster.
#include "cube_map.glsl"
#include "bias.glsl"
#ifndef FAR
in vec3 away;
#endif
out vec4 contents;

void main() {
#ifdef FAR
    contents = filter_contents(1.0);
#else
    gl_FragDepth = length(away) / map_far;
    contents = filter_contents(gl_FragDepth);
#endif
}
