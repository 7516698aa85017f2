// Distance to the light, linear in [0, 1], and what the filter stores besides.
#include "cutout.glsl"
#include "shadow_map.glsl"
in vec3 away;
out vec4 contents;

void main() {
    cut_out();
    gl_FragDepth = length(away) / map_far;
    contents = filter_contents(gl_FragDepth);
}
