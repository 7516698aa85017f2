// Casters relative to the light, projected onto one face, or passed to the geometry shader (LAYERS_GEOMETRY).
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
