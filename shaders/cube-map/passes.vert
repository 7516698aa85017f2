// Casters relative to the light, projected onto one face.
#include "cube_faces.glsl"
#include "cutout.glsl"
in vec3 position;
out vec3 away;
uniform vec3 light_position;
uniform int face;

void main() {
    pass_cutout();
    away = position - light_position;
    gl_Position = project(face, away);
}
