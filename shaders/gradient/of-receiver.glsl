// The gradient is that of the receiver's plane: a filter asks for it, and the bias has none.
#include "gradient/plane.glsl"

ShadowCoord with_gradient(ShadowCoord p) {
    p.gradient = plane_gradient(p);
    return p;
}
