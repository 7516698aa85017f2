// What engines publish is for a sun's depths z and b of [0, 1], receiver and blockers, by which penumbrae depend on the map's
// depth range.
#include "filter/depth-ratio.glsl"
#include "units.glsl"
uniform float filter_light;  // size of the light in the engine's unit; 0 as shipped

float size_or(float shipped) { return filter_light > 0.0 ? filter_light : shipped; }
float map_side(ShadowCoord p) { return map_size * sqrt(p.texel.x * p.texel.y); }  // across the receiver
