// Percentage-closer soft shadows (Fernando 2005), with depths as distances in the scene.
#include "filter/disc.glsl"
#include "penumbra.glsl"

// Depths in front of the near plane too, where the map itself clamps.
vec4 filter_contents(float depth) { return vec4(depth, 0.0, 0.0, 0.0); }

// Mean distance from the receiver to the blockers in a disc of this radius; negative if there are none.
float mean_gap(ShadowCoord p, mat3 across, float radius, mat2 turned) {
    float sum = 0.0, blockers = 0.0;
    for (int i = 0; i < FILTER_SEARCH; ++i) {
        vec2 offset = offset_across(across, radius * turned * disc_point(i, FILTER_SEARCH));
        float stored = contents_at(p, offset).x;
        if (stored >= plane_depth(p, offset)) continue;
        sum += p.linear - stored;
        ++blockers;
    }
    return blockers == 0.0 ? -1.0 : max(sum / blockers, 0.0) / p.linear_per_length;
}

float filter_visibility(ShadowCoord p) {
    mat2 turned = turn();
    mat3 across = texels_across(p);
    float smallest = 0.5 * length(p.texel);
    float gap = mean_gap(p, across, max(widest_penumbra(p), smallest), turned);
    if (gap < 0.0) return 1.0;
    float radius = max(penumbra_radius(p, gap), smallest), lit = 0.0;
    for (int i = 0; i < FILTER_TAPS; ++i)
        lit += compare_nearest(p, offset_across(across, radius * turned * disc_point(i, FILTER_TAPS)));
    return lit / float(FILTER_TAPS);
}
