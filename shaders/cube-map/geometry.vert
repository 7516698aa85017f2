// Casters relative to the light, for faces.geom.
#include "cutout.glsl"
in vec3 position;
out vec3 from_light;
uniform vec3 light_position;

void main() {
    pass_cutout();
    from_light = position - light_position;
}
