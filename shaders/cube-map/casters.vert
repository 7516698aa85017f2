// Casters seen from the light: on one face, or left to the geometry shader.
in vec3 position;
uniform vec3 light_position;
#ifdef LAYERS_GEOMETRY
out vec3 from_light;

void main() { from_light = position - light_position; }
#else
#include "cube_faces.glsl"
uniform int face;
out vec3 away;

void main() {
    away = position - light_position;
    gl_Position = project(face, away);
}
#endif
