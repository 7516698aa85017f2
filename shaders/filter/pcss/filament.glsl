// A bulb's radius in metres: surface_shadowing.fs, where (b - z)/(1 - b) is of reversed depths.
#include "filter/pcss/engine.glsl"
#include "filter/pcss/unlightened.glsl"

float search_radius(ShadowCoord p) { return size_or(0.02) * metre; }
float penumbra_estimate(ShadowCoord p, float gap) { return search_radius(p) * depth_ratio(p, gap); }
