// Casters in the light's clip space.
#include "cutout.glsl"
in vec3 position;
out float linear_depth;  // along the light's axis: 0 at the near plane, 1 at the far plane, negative in front of near
uniform mat4 world_to_clip;
uniform vec4 caster_to_linear;

void main() {
    gl_Position = world_to_clip * vec4(position, 1.0);
    pass_cutout();
    linear_depth = dot(caster_to_linear, vec4(position, 1.0));
}
