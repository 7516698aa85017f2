float filter_visibility(ShadowCoord p) { return compare_linear(p, vec2(0.0)); }
