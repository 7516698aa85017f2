// A cut-out, where a texel of the map may be opaque in one part and clear in another.
#include "hybrid/silhouette/nearest.glsl"
#include "cutout.glsl"
#ifdef CUTOUTS
const float MOST = 12.0;  // sub-texels along a side of what is looked at; more are taken to differ

// Whether all is opaque, or all clear, of what the texel covers of the triangle's plane.
bool is_uniform(vec2 reach) {
    ivec4 bitmap = bitmap_of(cutout.face.x);
    vec2 first = floor(cutout.place - reach), last = floor(cutout.place + reach);
    if (!all(lessThan(last - first, vec2(MOST)))) return false;
    bool opaque = is_set(bitmap, first);
    for (float y = first.y; y <= last.y; ++y)
        for (float x = first.x; x <= last.x; ++x)
            if (is_set(bitmap, vec2(x, y)) != opaque) return false;
    return true;
}
vec2 half_a_texel() { return 0.6 * fwidth(cutout.place) + 1e-3; }  // and more for rounding
#else
vec2 half_a_texel() { return vec2(0.0); }
bool is_uniform(vec2 reach) { return false; }
#endif

void main() {
    vec2 reach = half_a_texel();  // first, as derivatives need all four fragments
    store_nearest();
    if (is_uniform(reach)) discard;
}
