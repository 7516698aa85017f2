// Sum of two biases: their offsets, depths and gradients add up.
#include "bias.glsl" with bias = bias_first
#include "bias.glsl" with bias = bias_second
#define BIAS_HAS_OFFSET
#define BIAS_HAS_DEPTH

vec3 bias_offset(Receiver r, ShadowCoord p) { return bias_first_offset(r, p) + bias_second_offset(r, p); }

float bias_depth(Receiver r, ShadowCoord p) { return bias_first_depth(r, p) + bias_second_depth(r, p); }

#if defined(BIAS_FIRST_HAS_GRADIENT) || defined(BIAS_SECOND_HAS_GRADIENT)
#define BIAS_HAS_GRADIENT
vec2 bias_gradient(Receiver r, ShadowCoord p) { return bias_first_gradient(r, p) + bias_second_gradient(r, p); }
#endif
