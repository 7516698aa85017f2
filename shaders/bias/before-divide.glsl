// Subtracted from the homogeneous depth, as shaders do that leave the division to textureProj: z/w becomes (z - bias)/w.
#define BIAS_HAS_DEPTH
uniform float bias_units;
#ifndef METRE  // a sum may take this file twice
#define METRE
uniform float metre;  // local length: w is the distance along a spot's axis, in the file's units
#endif

float bias_depth(Receiver r, ShadowCoord p) { return light.w > 0.0 ? bias_units * metre / p.axis_distance : bias_units; }
