#define BIAS_HAS_DEPTH
uniform float bias_units;

float bias_depth(Receiver r, MapPoint p) { return bias_units; }
