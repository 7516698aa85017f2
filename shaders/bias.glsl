// The interface of a depth bias. A bias file defines any of
//   BIAS_HAS_OFFSET    vec3 bias_offset(Receiver r, ShadowCoord p): offset of the receiver before its projection
//   BIAS_HAS_DEPTH     float bias_depth(Receiver r, ShadowCoord p): subtracted from the receiver's depth
//   BIAS_HAS_GRADIENT  vec2 bias_gradient(Receiver r, ShadowCoord p): gradient of the receiver's depth over uv
// and the others are 0.
#include <bias>

#ifndef BIAS_HAS_OFFSET
vec3 bias_offset(Receiver r, ShadowCoord p) { return vec3(0.0); }
#endif
#ifndef BIAS_HAS_DEPTH
float bias_depth(Receiver r, ShadowCoord p) { return 0.0; }
#endif
#ifndef BIAS_HAS_GRADIENT
vec2 bias_gradient(Receiver r, ShadowCoord p) { return vec2(0.0); }
#endif
