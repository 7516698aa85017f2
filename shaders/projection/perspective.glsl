// From a spot, or along any directional light's rays.
#include "projection/matrix.glsl"

ShadowCoord projected(ShadowCoord p) { return divided(p, world_to_map[p.layer] * vec4(p.position, 1.0)); }
