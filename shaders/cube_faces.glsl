// The faces +X −X +Y −Y +Z −Z in OpenGL's order and orientation: columns s, t and the face's axis. A direction is
// cube_faces[f] * vec3(s, t, 1) with s and t in [−1, 1]; the inverse is v * cube_faces[f]. Entries of 0 and ±1 make
// both exact, so that there are no cracks between faces.
const mat3 cube_faces[6] = mat3[6](
    mat3(0.0, 0.0, -1.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0),
    mat3(0.0, 0.0, 1.0, 0.0, -1.0, 0.0, -1.0, 0.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, -1.0, 0.0),
    mat3(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0),
    mat3(-1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0)
);

uniform float near;

// Clip space of one face, for a position relative to the light. The fragment shader writes the stored distance; z only
// clips at w = near, far below any relevant distance, and stays well inside the depth range beyond it.
vec4 project(int face, vec3 away) {
    vec3 on_face = away * cube_faces[face];
    return vec4(on_face.xy, 0.5 * on_face.z - 1.5 * near, on_face.z);
}
