// Two biases that act together: their moves, depths and gradients add up.
#include "bias/whole.glsl" with bias = bias_first
#include "bias/whole.glsl" with bias = bias_second
#define BIAS_HAS_MOVE
#define BIAS_HAS_DEPTH

vec3 bias_move(Receiver r, MapPoint p) { return bias_first_move(r, p) + bias_second_move(r, p); }

float bias_depth(Receiver r, MapPoint p) { return bias_first_depth(r, p) + bias_second_depth(r, p); }

#if defined(BIAS_FIRST_HAS_GRADIENT) || defined(BIAS_SECOND_HAS_GRADIENT)
#define BIAS_HAS_GRADIENT
vec2 bias_gradient(Receiver r, MapPoint p) { return bias_first_gradient(r, p) + bias_second_gradient(r, p); }
#endif
