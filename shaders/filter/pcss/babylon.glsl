// A share of the map's side; z - b without a division: shadowsFragmentFunctions.fx.
#include "filter/pcss/engine.glsl"

float search_radius(ShadowCoord p) { return size_or(0.1) * map_side(p); }
float penumbra_estimate(ShadowCoord p, float gap) {
    return search_radius(p) * (gap * p.linear_per_length + 10.0 / map_size);
}

// Shadow is lightened by the distance to the blockers, umbrae too.
float lightened(ShadowCoord p, float gap, float visibility) {
    return mix(visibility, 1.0, clamp(gap * p.linear_per_length, 0.0, 1.0));
}
