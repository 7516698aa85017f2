// A share of the map's side, and a near plane of 9.5 though depths end at 1: webgl_shadowmap_pcss.html.
#include "filter/pcss/engine.glsl"
#include "filter/pcss/unlightened.glsl"

const float near_plane = 9.5;
float search_radius(ShadowCoord p) {
    return size_or(0.005 / 3.75) * map_side(p) * abs(p.linear - near_plane) / max(p.linear, 1e-4);
}
float penumbra_estimate(ShadowCoord p, float gap) {
    return size_or(0.005 / 3.75) * map_side(p) * depth_ratio(p, gap) * near_plane / max(p.linear, 1e-4);
}
