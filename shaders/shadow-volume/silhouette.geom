// Walls of the edges whose weight is not zero: the silhouette.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 8) out;
in vec3 world[];
flat in int id[];
#include "shadow-volume/wall.glsl"

void main() {
    Corner c = Corner(world[0], id[0]), a = Corner(world[1], id[1]), b = Corner(world[2], id[2]),
           d = Corner(world[3], id[3]);
    wall(a.position, b.position, wall_weight(c, a, b, d));
}
