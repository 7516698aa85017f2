// Volumes extruded on the CPU; w = 0 at infinity.
in vec4 point;
uniform mat4 world_to_clip;
uniform float sign_drawn;
flat out float weight;
#if defined(WALL) && defined(COMPARE_POSITION)
in vec3 from;
in vec3 to;
flat out vec3 edge_a;
flat out vec3 edge_b;
#endif

void main() {
    precise vec4 clip = world_to_clip * point;
    gl_Position = clip;
    gl_ClipDistance[0] = clip.z + clip.w;
    weight = sign_drawn;
#if defined(WALL) && defined(COMPARE_POSITION)
    edge_a = from;
    edge_b = to;
#endif
}
