// That of the bias, if it has one: without, all texels are compared with the same depth.
ShadowCoord with_gradient(ShadowCoord p) { return p; }
