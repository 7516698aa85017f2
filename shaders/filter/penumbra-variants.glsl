// Radii of the blocker search and of the penumbra, as local lengths: by similar triangles in the scene, or as engines publish
// them for a sun's depths z and b of [0, 1], receiver and blockers, by which they depend on the map's depth range. `gap` is
// the distance from blockers to receiver.
#include "penumbra.glsl"
#include "filter/depth-ratio.glsl"
uniform float filter_light;  // size of the light in the engine's unit; 0 as shipped
#ifndef METRE
#define METRE
uniform float metre;
#endif

float size_or(float shipped) { return filter_light > 0.0 ? filter_light : shipped; }
float map_side(ShadowCoord p) { return map_size * sqrt(p.texel.x * p.texel.y); }  // across the receiver

#if defined(FILTER_VARIANT_GODOT)
// The sun's angular diameter as a radius, by the distance to the near plane: scene_forward_lights_inc.glsl.
float search_radius(ShadowCoord p) {
    if (light.w > 0.0) return light_radius;
    return tan(filter_light > 0.0 ? radians(filter_light) : 2.0 * atan(light_radius)) * p.linear / p.linear_per_length;
}
float penumbra_estimate(ShadowCoord p, float gap) { return search_radius(p) * depth_ratio(p, gap); }

#elif defined(FILTER_VARIANT_FILAMENT)
// A bulb's radius in metres: surface_shadowing.fs, where (b - z)/(1 - b) is of reversed depths.
float search_radius(ShadowCoord p) { return size_or(0.02) * metre; }
float penumbra_estimate(ShadowCoord p, float gap) { return search_radius(p) * depth_ratio(p, gap); }

#elif defined(FILTER_VARIANT_BEVY)
// Metres; (b - z)/z of reversed depths, and a factor by the texel's width in metres: shadow_sampling.wgsl.
float search_radius(ShadowCoord p) { return size_or(10.0) * metre; }
float penumbra_estimate(ShadowCoord p, float gap) {
    float blur = max(size_or(10.0) * gap * p.linear_per_length / max(1.0 - p.linear, 1e-4), 0.5);
    float fudge = 0.015 + (map_side(p) / map_size / metre - 0.00390625) * 0.02 / (0.022949219 - 0.00390625);
    return fudge * blur * metre;
}

#elif defined(FILTER_VARIANT_BABYLON)
// A share of the map's side; z - b without a division: shadowsFragmentFunctions.fx.
float search_radius(ShadowCoord p) { return size_or(0.1) * map_side(p); }
float penumbra_estimate(ShadowCoord p, float gap) {
    return search_radius(p) * (gap * p.linear_per_length + 10.0 / map_size);
}

#elif defined(FILTER_VARIANT_THREE)
// A share of the map's side, and a near plane of 9.5 though depths end at 1: webgl_shadowmap_pcss.html.
const float near_plane = 9.5;
float search_radius(ShadowCoord p) {
    return size_or(0.005 / 3.75) * map_side(p) * abs(p.linear - near_plane) / max(p.linear, 1e-4);
}
float penumbra_estimate(ShadowCoord p, float gap) {
    return size_or(0.005 / 3.75) * map_side(p) * depth_ratio(p, gap) * near_plane / max(p.linear, 1e-4);
}

#else
float search_radius(ShadowCoord p) { return widest_penumbra(p); }
float penumbra_estimate(ShadowCoord p, float gap) { return penumbra_radius(p, gap); }
#endif

// Babylon.js lightens shadow by the distance to the blockers, umbrae too.
float lightened(ShadowCoord p, float gap, float visibility) {
#ifdef FILTER_VARIANT_BABYLON
    return mix(visibility, 1.0, clamp(gap * p.linear_per_length, 0.0, 1.0));
#else
    return visibility;
#endif
}
