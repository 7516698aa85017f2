// The three walls of each triangle with a weight.
layout(triangles) in;
layout(triangle_strip, max_vertices = 12) out;
in vec3 world[];
flat in int id[];
#include "shadow-volume/wall.glsl"

void main() {
    float side = facing(Corner(world[0], id[0]), Corner(world[1], id[1]), Corner(world[2], id[2]));
    float count = cap_weight(side);
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3;
        bool rising = id[k] < id[next];
        wall(world[rising ? k : next], world[rising ? next : k], rising ? count : -count);
    }
}
