// No bias, or one of the depth pass (polygon offset, front-face culling).
ShadowCoord bias(ShadowCoord p) { return p; }
