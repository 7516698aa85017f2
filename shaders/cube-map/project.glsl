#include "cube_faces.glsl"
uniform float near;

// Clip space of one face. Distances are written by the fragment shader, so that depth here need only clip at w = near,
// far below any distance that matters, and lie well inside the range beyond it.
vec4 project(int face, vec3 away) {
    vec3 on_face = away * cube_faces[face];
    return vec4(on_face.xy, 0.5 * on_face.z - 1.5 * near, on_face.z);
}
