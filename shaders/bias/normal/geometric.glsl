ShadowCoord with_bias_normal(ShadowCoord p) { return p; }
