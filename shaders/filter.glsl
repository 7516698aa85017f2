// The interface of a filter, a file that defines
//   float filter_visibility(ShadowCoord p)    visibility of a receiver
//   vec4 filter_contents(float depth)         if it has `contents` in Python: what the map stores for a caster at a linear
//                                             depth, which is negative for casters in front of the near plane
// by these functions, with offsets in texels from the receiver's own point:
//   float compare_nearest(ShadowCoord p, vec2 offset)    of the nearest texel: 1 lit, 0 in shadow
//   float compare_linear(ShadowCoord p, vec2 offset)     of the four nearest, with bilinear weights
//   vec4 contents_at(ShadowCoord p, vec2 offset)         what the filter stored there, blurred and from the mip levels
// Texels are compared with the receiver's depth, or if `on_plane` is true in Python each with the receiver's plane there.
// Filters as wide as the scene asks for may include plane.glsl.
#include "map/<map>.glsl"
#include "comparison/<comparison>.glsl"
#include "contents/<contents>.glsl"
#include <filter>
