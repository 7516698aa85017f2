// The interface of a bias, a file that defines
//   ShadowCoord bias(ShadowCoord p)    the receiver's point with a larger `bias`, another `gradient`, or `moved`
// by the functions of slopes.glsl and
//   float radius(ShadowCoord p)        largest distance of a compared texel's points from the receiver's point, in texels
#include "slopes.glsl"
#include <radius>
#include <bias>
