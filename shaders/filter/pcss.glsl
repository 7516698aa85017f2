// Percentage-closer soft shadows (Fernando 2005).
#include "filter/blockers.glsl"

// A variant defines the radii of the blocker search and of the penumbra as local lengths, and what it makes of visibility;
// gap: the distance from blockers to receiver.
float search_radius(ShadowCoord p);
float penumbra_estimate(ShadowCoord p, float gap);
float lightened(ShadowCoord p, float gap, float visibility);
#include "filter/pcss/<filter_variant>.glsl"

float filter_visibility(ShadowCoord p) {
    mat2 turned = turn();
    mat3 across = texels_across(p);
    float smallest = 0.5 * length(p.texel);
    vec2 found = blockers(p, across, max(search_radius(p), smallest), turned, FILTER_SEARCH);
    if (found.y == 0.0) return 1.0;
    float radius = max(penumbra_estimate(p, found.x), smallest), lit = 0.0;
    for (int i = 0; i < FILTER_TAPS; ++i)
        lit += compare_nearest(p, offset_across(across, radius * turned * disc_point(i, FILTER_TAPS)));
    return lightened(p, found.x, lit / float(FILTER_TAPS));
}
