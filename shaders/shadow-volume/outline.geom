// Edges with a wall, widened to cover the centre of every texel that they touch: a ray through a texel crosses at most
// the layers of the ray through its centre plus the weights of the edges between the two.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 24) out;
in vec3 world[];
flat in int id[];
#include "shadow-volume/tiles.glsl"
uniform vec2 texel;  // of a tile in its own clip space, −1 to 1

const float nearest = 1e-6;  // edges are clipped this close to the light, below the resolution of its rays

void main() {
    Corner c = Corner(world[0], id[0]), first = Corner(world[1], id[1]), last = Corner(world[2], id[2]),
           d = Corner(world[3], id[3]);
    float count = abs(wall_weight(c, first, last, d));
    if (count == 0.0) return;
    for (int face = 0; face < faces; face++) {
        vec4 a = world_to_face[face] * vec4(first.position, 1.0), b = world_to_face[face] * vec4(last.position, 1.0);
        if (max(a.w, b.w) <= nearest) continue;
        if (a.w < nearest) a = mix(a, b, (nearest - a.w) / (b.w - a.w));
        if (b.w < nearest) b = mix(b, a, (nearest - b.w) / (a.w - b.w));
        vec2 from = a.xy / a.w, to = b.xy / b.w;
        vec2 along = (to - from) / texel;
        float size = length(along);
        along = size > 0.0 ? along / size : vec2(1.0, 0.0);
        // Half a texel's diagonal on all sides, plus a margin for the rasteriser's subpixel grid.
        vec2 ahead = along * texel * 0.75, across = vec2(-along.y, along.x) * texel * 0.75;
        corner(vec4(from - ahead - across, 0.0, 1.0), face, count);
        corner(vec4(from - ahead + across, 0.0, 1.0), face, count);
        corner(vec4(to + ahead - across, 0.0, 1.0), face, count);
        corner(vec4(to + ahead + across, 0.0, 1.0), face, count);
        EndPrimitive();
    }
}
