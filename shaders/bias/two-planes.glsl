// Slack for relief smaller than a texel, which grows with the distance to the texel's centre: where normals differ by a
// little, slopes differ by the more, the steeper they are. And for rounding. Chosen over the built-in scenes: with less, rough
// ground has acne, with more, contact shadows are lost; with a slack that is the same for all texels, a few of many are dark.
#include "units.glsl"

ShadowCoord bias(ShadowCoord p) {
#if PARALLEL == 1  // in half the time, as the map's axes are at right angles to its rays
    p.gradient = (mat3(world_to_map[p.layer]) * p.receiver.normal).xy * p.texel * p.texel
               * (map_size * map_size * depth_sign * p.depth_per_length / p.receiver.cosine);
#else
    p.gradient = plane_gradient(p);
#endif
    float width = max(p.texel.x, p.texel.y) * p.depth_per_length, steep = tan_slope(p);
    p.slack = min(0.015 + steep * (0.08 + 0.015 * steep), 3.0) * width;
    p.longest = (12.0 + 36.0 * light.w) * width;  // spots and lamps light all at once from square to grazing
    // Corners are snapped by up to half a step of the rasteriser's grid along each axis.
    p.bias += subpixel * steep * width + 4.0 * resolution(p);
    return p;
}
