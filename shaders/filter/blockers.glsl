// Blocker search (Fernando 2005) over a disc. Stored are depths, in front of the near plane too, where the map itself clamps.
#include "filter/disc.glsl"
#include "plane.glsl"

vec4 filter_contents(float depth) { return vec4(depth, 0.0, 0.0, 0.0); }

// Mean distance from the receiver to the blockers in a disc of this radius, and the share of the `count` taps that they are.
vec2 blockers(ShadowCoord p, mat3 across, float radius, mat2 turned, int count) {
    float sum = 0.0, found = 0.0;
    for (int i = 0; i < count; ++i) {
        vec2 offset = offset_across(across, radius * turned * disc_point(i, count));
        float stored = contents_at(p, offset).x;
        if (!blocks(p, offset, stored)) continue;
        sum += p.linear - stored;
        ++found;
    }
    return vec2(max(sum / max(found, 1.0), 0.0) / p.linear_per_length, found / float(count));
}
