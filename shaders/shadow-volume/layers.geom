// Triangles with a cap, seen from the light.
layout(triangles) in;
layout(triangle_strip, max_vertices = 18) out;
in vec3 world[];
flat in int id[];
#include "shadow-volume/tiles.glsl"

void main() {
    float count = abs(cap_weight(facing(Corner(world[0], id[0]), Corner(world[1], id[1]), Corner(world[2], id[2]))));
    if (count == 0.0) return;
    for (int face = 0; face < faces; face++) {
        for (int k = 0; k < 3; k++) corner(world_to_face[face] * vec4(world[k], 1.0), face, count);
        EndPrimitive();
    }
}
