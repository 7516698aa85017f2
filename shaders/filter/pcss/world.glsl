// By similar triangles in the scene.
#include "filter/pcss/unlightened.glsl"
#include "penumbra.glsl"

float search_radius(ShadowCoord p) { return widest_penumbra(p); }
float penumbra_estimate(ShadowCoord p, float gap) { return penumbra_radius(p, gap); }
