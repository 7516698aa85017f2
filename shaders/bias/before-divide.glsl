// Subtracted from the homogeneous depth, as in shaders that call textureProj: z/w becomes (z - bias)/w.
#define BIAS_HAS_DEPTH
uniform float bias_units;
#ifndef METRE  // a sum may include this file twice
#define METRE
uniform float metre;  // one metre as a local length: published biases are for w, the distance along the axis, in metres
#endif

float bias_depth(Receiver r, ShadowCoord p) { return light.w > 0.0 ? bias_units * metre / p.axis_distance : bias_units; }
