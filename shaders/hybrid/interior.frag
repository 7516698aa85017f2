// A cut-out, where a texel of the map may be opaque in one part and clear in another.
#include "hybrid/silhouette/nearest.glsl"
#ifdef CUTOUTS
#include "cutout.glsl"
in Cutout { vec3 place; flat ivec2 face; } cutout;
const float MOST = 6.0;  // α₈ along a side of what is looked at; more are taken to differ

// Whether all is opaque, or all clear, of what the texel covers of the triangle's plane.
bool is_uniform(vec3 reach) {
    ivec2 row = texel_of(cutout.face.x) * ivec2(2, 1);
    ivec4 image = texelFetch(cutout_table, row, 0), rest = texelFetch(cutout_table, row + ivec2(1, 0), 0);
    vec3 size = vec3(image.yz, 1.0), at = cutout.place * size;
    reach = reach * size + 1e-4;
    float mixed = image.w == 1 ? 0.0 : 0.5;  // with those around
    vec2 first = floor(at.xy - reach.xy - mixed), last = floor(at.xy + reach.xy + mixed);
    if (!all(lessThan(last - first, vec2(MOST)))) return false;
    float low = 255.0, high = 0.0;
    for (float y = first.y; y <= last.y; ++y)
        for (float x = first.x; x <= last.x; ++x) {
            float alpha = alpha_of(image, wrapped(vec2(x, y), size.xy, rest.xy));
            low = min(low, alpha);
            high = max(high, alpha);
        }
    float least = intBitsToFloat(rest.z);
    return low * (at.z - reach.z) >= least || high * (at.z + reach.z) < least;
}
vec3 half_a_texel() { return 0.6 * fwidth(cutout.place); }  // and more for rounding
#else
vec3 half_a_texel() { return vec3(0.0); }
bool is_uniform(vec3 reach) { return false; }
#endif

void main() {
    vec3 reach = half_a_texel();  // first, as derivatives need all four fragments
    store_nearest();
    if (is_uniform(reach)) discard;
}
