// One triangle in perspective that covers the target: positions and interpolation depend on how products are rounded.
out vec3 point;
const mat4 to_clip = mat4(1.7, 0.3, 0.1, 0.2, -0.4, 1.9, 0.2, 0.1, 0.3, -0.2, 1.1, 0.7, 0.1, 0.2, 0.3, 1.3);

void main() {
    vec2 corner = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0;
    vec4 clip = to_clip * vec4(corner, 0.37, 1.0);
    float w = 1.0 + 0.3 * float(gl_VertexID);
    point = clip.xyz / 3.0;
    gl_Position = vec4(corner * w, 0.1 * w, w);
}
