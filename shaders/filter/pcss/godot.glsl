// The sun's angular diameter as a radius, by the distance to the near plane: scene_forward_lights_inc.glsl.
#include "filter/pcss/engine.glsl"
#include "filter/pcss/unlightened.glsl"
#include "penumbra.glsl"

float search_radius(ShadowCoord p) {
    if (light.w > 0.0) return light_radius;
    return tan(filter_light > 0.0 ? radians(filter_light) : 2.0 * atan(light_radius)) * p.linear / p.linear_per_length;
}
float penumbra_estimate(ShadowCoord p, float gap) { return search_radius(p) * depth_ratio(p, gap); }
