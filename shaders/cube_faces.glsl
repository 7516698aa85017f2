// The faces +X −X +Y −Y +Z −Z as OpenGL numbers and turns them: columns s, t and the face's axis. A direction is
// cube_faces[f] * vec3(s, t, 1) with s and t in [−1, 1]; v * cube_faces[f] is the way back. Entries of 0 and ±1 make
// both exact, so that faces meet to the last bit.
const mat3 cube_faces[6] = mat3[6](
    mat3(0.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0),
    mat3(0.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, -1.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0),
    mat3(-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)
);

uniform float near;

// Clip space of one face. Distances are written by the fragment shader, so that depth here need only clip at w = near,
// far below any distance that matters, and lie well inside the range beyond it.
vec4 project(int face, vec3 away) {
    vec3 on_face = away * cube_faces[face];
    return vec4(on_face.xy, 0.5 * on_face.z - 1.5 * near, on_face.z);
}
