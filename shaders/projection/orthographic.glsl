// Along parallel rays, those of a directional light: w is 1, and known to the compiler it saves all that depends on it.
#include "projection/matrix.glsl"

ShadowCoord projected(ShadowCoord p) { return divided(p, vec4((world_to_map[p.layer] * vec4(p.position, 1.0)).xyz, 1.0)); }
