// Distance to the light, linear in [0, 1].
#include "cutout.glsl"
#include "gradient.glsl"
in vec3 away;
uniform float map_far;

void main() {
    store_gradient();
    cut_out();
    gl_FragDepth = length(away) / map_far;
}
