#include "cube_faces.glsl"
uniform vec3 light_position;
uniform int face;

vec4 clip_of(vec3 position) { return project(face, position - light_position); }
