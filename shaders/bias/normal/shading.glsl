#include "shading_normal.glsl"

ShadowCoord with_bias_normal(ShadowCoord p) {
    p.receiver.normal = shading_normal(p.receiver);
    p.receiver.cosine = dot(p.receiver.normal, p.receiver.to_light);
    return p;
}
