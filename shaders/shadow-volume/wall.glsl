// The wall of an edge, always wound from a to b to infinity: with the opposite winding, rounding would rasterise the same
// wall differently, and walls that should cancel would leave single pixels.
#include "shadow-volume/extrude.glsl"
#ifdef COMPARE_POSITION
flat out vec3 edge_a;
flat out vec3 edge_b;
#endif

void wall(vec3 a, vec3 b, float count) {
    int times = times_drawn(count);
    if (times == 0) return;
    vec4 near_a = clip_of(vec4(a, 1.0)), near_b = clip_of(vec4(b, 1.0));
    vec4 far_a = clip_of(away(a)), far_b = clip_of(away(b));
    // For a directional light both far corners are the same point, and the wall is a triangle.
    int corners_drawn = light.w == 0.0 ? 3 : 4;
    for (int n = 0; n < times; n++) {
        for (int k = 0; k < corners_drawn; k++) {
            gl_Position = k == 0 ? near_a : k == 1 ? near_b : k == 2 ? far_a : far_b;
            weight = count;
#ifdef COMPARE_POSITION
            edge_a = a;
            edge_b = b;
#endif
            EmitVertex();
        }
        EndPrimitive();
    }
}
