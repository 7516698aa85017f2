// The chosen bias. A bias file defines what it needs of
//   BIAS_HAS_OFFSET    vec3 bias_offset(Receiver r, ShadowCoord p): how far the receiver moves before it is projected
//   BIAS_HAS_DEPTH     float bias_depth(Receiver r, ShadowCoord p): what is subtracted from its depth
//   BIAS_HAS_GRADIENT  vec2 bias_gradient(Receiver r, ShadowCoord p): its depth's gradient over uv
// and the rest is nothing.
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
