// The light's view in one target: one tile for a directional light, 3 × 2 cube faces for spot and point lights.
#include "shadow-volume/facing.glsl"
uniform mat4 world_to_face[6];
uniform int faces;
flat out float weight;

// Emits a vertex into a face's tile, clipped to the tile.
void corner(vec4 clip, int face, float count) {
    gl_ClipDistance[0] = clip.w + clip.x;
    gl_ClipDistance[1] = clip.w - clip.x;
    gl_ClipDistance[2] = clip.w + clip.y;
    gl_ClipDistance[3] = clip.w - clip.y;
    if (faces > 1) {
        vec2 tile = vec2(face % 3, face / 3);
        clip.xy = (clip.xy + (2.0 * tile + 1.0) * clip.w) / vec2(3.0, 2.0) - clip.w;
    }
    gl_Position = clip;
    weight = count;
    EmitVertex();
}
