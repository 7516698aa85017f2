// Distance to the light, linear in [0, 1], and what the filter stores besides.
#include "cutout.glsl"
#include "gradient.glsl"
#include "shadow_map.glsl"
in vec3 away;
layout(location = 0) out vec4 contents;

void main() {
    store_gradient();
    cut_out();
    gl_FragDepth = length(away) / map_far;
    contents = filter_contents(gl_FragDepth);
}
