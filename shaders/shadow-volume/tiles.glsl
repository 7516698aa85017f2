// The light's surroundings on one target: parallel light has one tile, a lamp the six faces of a cube in 3 × 2.
#include "shadow-volume/facing.glsl"
uniform mat4 world_to_face[6];
uniform int faces;
flat out float weight;

// Into a face's tile, clipped to it.
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
