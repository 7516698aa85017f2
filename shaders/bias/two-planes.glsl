// Slack for what is smaller than a texel, and for rounding: by the distance to the texel's centre a tenth of the plane's
// own change of depth. Less leaves acne on rough ground; with a slack that is the same for all texels, a few of many are dark.
#include "units.glsl"
const float relief = 0.1, steepest = 50.0;  // of tan θ

ShadowCoord bias(ShadowCoord p) {
    p.gradient = plane_gradient(p);
    float width = max(p.texel.x, p.texel.y) * p.depth_per_length, steep = tan_slope(p);
    p.bias_per_texel = relief * min(steep, steepest) * width;
    p.most = 32.0 * radius(p) * width;
    // Corners are snapped by up to half a step of the rasteriser's grid along each axis.
    p.bias += 0.5 * subpixel * sqrt(2.0) * steep * width + 4.0 * resolution(p);
    return p;
}
