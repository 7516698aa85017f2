// A bias with all three of its functions, the missing ones nothing.
#include <bias>

#ifndef BIAS_HAS_MOVE
vec3 bias_move(Receiver r, MapPoint p) { return vec3(0.0); }
#endif
#ifndef BIAS_HAS_DEPTH
float bias_depth(Receiver r, MapPoint p) { return 0.0; }
#endif
#ifndef BIAS_HAS_GRADIENT
vec2 bias_gradient(Receiver r, MapPoint p) { return vec2(0.0); }
#endif
