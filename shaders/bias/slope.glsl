#define BIAS_HAS_DEPTH
uniform float bias_max;
uniform float bias_min;

float bias_depth(Receiver r, ShadowCoord p) { return max(bias_max * (1.0 - r.cosine), bias_min); }
