// Subtracted from the homogeneous depth, as in shaders that call textureProj: z/w becomes (z - bias)/w. Published biases are
// for w, the distance along the axis, in metres.
#include "units.glsl"
uniform float bias_units;

ShadowCoord bias(ShadowCoord p) {
    p.bias += light.w > 0.0 ? bias_units * metre / p.axis_distance : bias_units;
    return p;
}
