#define BIAS_HAS_DEPTH
uniform float bias_units;
uniform float bias_world;

float bias_depth(Receiver r, ShadowCoord p) { return bias_world > 0.0 ? bias_world * p.depth_per_length : bias_units; }
