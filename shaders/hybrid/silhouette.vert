// An edge of the casters' silhouette as a rectangle that covers the centre of each texel that it crosses.
in vec3 a;
in vec3 b;
out vec3 point;  // on the edge
#include "hybrid/silhouette/clip-<map>.glsl"

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);  // outside
    vec4 clip_a = clip_of(a), clip_b = clip_of(b);
    vec2 part = vec2(0.0, 1.0);  // of the edge that is before the light and near the map
    for (int side = 0; side < 4; ++side) {
        vec2 at = vec2(clip_a[side / 2], clip_b[side / 2]) * (side % 2 == 0 ? 1.0 : -1.0);
        vec2 inside = 1.1 * vec2(clip_a.w, clip_b.w) - at;
        if (max(inside.x, inside.y) <= 0.0) return;
        float crossed = inside.x / (inside.x - inside.y);
        if (inside.x < 0.0) part.x = max(part.x, crossed);
        if (inside.y < 0.0) part.y = min(part.y, crossed);
    }
    if (part.x > part.y) return;
    vec4 from = mix(clip_a, clip_b, part.x), to = mix(clip_a, clip_b, part.y);
    vec2 along = to.xy / to.w - from.xy / from.w;
    along = along == vec2(0.0) ? vec2(1.0, 0.0) : normalize(along);
    vec2 across = vec2(-along.y, along.x);
    // From the centre of a texel to its border, in the direction of either side of the rectangle; 2 % more for rounding.
    float reach = 1.02 * (abs(along.x) + abs(along.y)) / float(SIZE);

    int corner = gl_VertexID % 6;
    bool is_end = corner == 2 || corner == 3 || corner == 5, is_left = corner == 1 || corner == 4 || corner == 5;
    gl_Position = is_end ? to : from;
    gl_Position.xy += reach * gl_Position.w * ((is_end ? along : -along) + (is_left ? across : -across));
    point = mix(a, b, is_end ? part.y : part.x);
}
