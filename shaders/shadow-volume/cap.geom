// The near cap, the triangle itself, and for spot and point lights the far cap at infinity (a point for a directional one).
layout(triangles) in;
layout(triangle_strip, max_vertices = 6) out;
in vec3 world[];
flat in int id[];
#include "shadow-volume/extrude.glsl"

void corner(vec4 clip, float count) {
    gl_Position = clip;
    gl_ClipDistance[0] = clip.z + clip.w;
    weight = count;
    EmitVertex();
}

void main() {
    float count = cap_weight(facing(Corner(world[0], id[0]), Corner(world[1], id[1]), Corner(world[2], id[2])));
    if (times_drawn(count) == 0) return;
    for (int k = 0; k < 3; k++) corner(clip_of(vec4(world[k], 1.0)), count);
    EndPrimitive();
    if (light.w == 0.0) return;
    for (int k = 2; k >= 0; k--) corner(clip_of(away(world[k])), count);
    EndPrimitive();
}
