// The chosen bias. A bias file defines what it needs of
//   BIAS_HAS_OFFSET    vec3 bias_offset(Receiver r, MapPoint p): how far the receiver moves before it is projected
//   BIAS_HAS_DEPTH     float bias_depth(Receiver r, MapPoint p): what is subtracted from its depth
//   BIAS_HAS_GRADIENT  vec2 bias_gradient(Receiver r, MapPoint p): its depth's gradient over uv
// and the rest is nothing.
#include <bias>

#ifndef BIAS_HAS_OFFSET
vec3 bias_offset(Receiver r, MapPoint p) { return vec3(0.0); }
#endif
#ifndef BIAS_HAS_DEPTH
float bias_depth(Receiver r, MapPoint p) { return 0.0; }
#endif
#ifndef BIAS_HAS_GRADIENT
vec2 bias_gradient(Receiver r, MapPoint p) { return vec2(0.0); }
#endif
