// That of the receiver's plane.
#include "gradient/plane.glsl"

ShadowCoord with_gradient(ShadowCoord p) {
    p.gradient = plane_gradient(p);
    return p;
}
