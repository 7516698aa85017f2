// Casters in world space for cascades/layers.geom, which projects them into each layer.
#include "cutout.glsl"
in vec3 position;
out vec3 world;

void main() {
    pass_cutout();
    world = position;
}
