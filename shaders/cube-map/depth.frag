// Distance to the light, linear in [0, 1].
#include "cutout.glsl"
in vec3 away;
uniform float map_far;

void main() {
    cut_out();
    gl_FragDepth = length(away) / map_far;
}
