// Occlusion by a bounding volume hierarchy that is walked without a stack: nodes are in depth-first order, and each says
// which one follows its subtree.
#include "triangle.glsl"
uniform usampler2D tree_nodes;     // box, lowest | highest << 16 in steps; node after the subtree, or LEAF and triangles
uniform sampler2D tree_triangles;  // three corners each, side by side; w of the first: 1 + index of a cut-out triangle
uniform int tree_size;             // nodes
uniform vec3 tree_low;             // lowest corner of the box of all
uniform vec3 tree_step;            // local lengths
const uint LEAF = 0x80000000u;     // then the first triangle times 8 plus their number
const float INFINITE = 1.0e30;
#define RAYS
#include "cutout.glsl"
#ifdef CUTOUTS
uniform sampler2D tree_cutouts;    // place in the cut-out, and its number, of three corners each, side by side

// Whether a triangle is opaque where a ray meets it; weights: of its corners, not normalised.
bool is_opaque_at(int i, vec3 weights) {
    int cut = int(texelFetch(tree_triangles, texel_of(i) * ivec2(3, 1), 0).w) - 1;
    if (cut < 0) return true;
    ivec2 first = texel_of(cut) * ivec2(3, 1);
    weights /= weights.x + weights.y + weights.z;
    vec4 corner = texelFetch(tree_cutouts, first, 0), place = corner;
    for (int k = 1; k < 3; ++k) place += weights[k] * (texelFetch(tree_cutouts, first + ivec2(k, 0), 0) - corner);
    return is_opaque(int(corner.z + 0.5), place.xy);
}
#else
bool is_opaque_at(int i, vec3 weights) { return true; }
#endif

// Whether a triangle lies within reach. The signs of three volumes (Plücker coordinates) say so; neighbours have the same
// one at their common edge but for its sign, so that no ray passes between them. a × b = (a − b) × (a + b) / 2 loses fewer
// digits to corners that are far from the ray's origin.
bool hits_triangle(int i, vec3 origin, vec3 direction, float reach) {
    ivec2 first = texel_of(i) * ivec2(3, 1);
    vec3 a = texelFetch(tree_triangles, first, 0).xyz - origin;
    vec3 b = texelFetch(tree_triangles, first + ivec2(1, 0), 0).xyz - origin;
    vec3 c = texelFetch(tree_triangles, first + ivec2(2, 0), 0).xyz - origin;
    precise vec3 volumes = vec3(dot(cross(b - c, b + c), direction), dot(cross(c - a, c + a), direction),
                                dot(cross(a - b, a + b), direction));
    vec3 normal = cross(b - a, c - a);
    float distance = dot(normal, a) / dot(normal, direction);  // NaN or infinite for a triangle seen edge-on
    bool inside = min(volumes.x, min(volumes.y, volumes.z)) >= 0.0 || max(volumes.x, max(volumes.y, volumes.z)) <= 0.0;
    return inside && distance > 0.0 && distance <= reach && is_opaque_at(i, volumes);
}

// Whether a triangle lies within reach in a unit direction. The inner loop walks nodes only, so that pixels that have found
// a leaf wait for those that have not, and all test triangles together.
bool occluded(vec3 origin, vec3 direction, float reach) {
    direction += vec3(equal(direction, vec3(0.0))) * 1e-20;  // no 0 · ∞
    vec3 scale = tree_step / direction, start = (tree_low - origin) / direction;
    int node = 0;
    bool hit = reach <= 0.0;
    while (node < tree_size && !hit) {
        uint leaf = 0u;
        while (node < tree_size && leaf == 0u) {
            uvec4 words = texelFetch(tree_nodes, texel_of(node), 0);
            vec3 low = start + vec3(words.xyz & 0xFFFFu) * scale, high = start + vec3(words.xyz >> 16u) * scale;
            vec3 enter = min(low, high), leave = max(low, high);
            bool inside = max(max(enter.x, enter.y), max(enter.z, 0.0)) <= min(min(leave.x, leave.y), min(leave.z, reach));
            bool is_leaf = words.w >= LEAF;
            leaf = inside && is_leaf ? words.w : 0u;
            node = inside || is_leaf ? node + 1 : int(words.w);
        }
        int first = int(leaf - LEAF) >> 3;
        for (int i = first; i < first + int(leaf & 7u); ++i) hit = hit || hits_triangle(i, origin, direction, reach);
    }
    return hit && reach > 0.0;
}
