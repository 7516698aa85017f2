float filter_visibility(ShadowCoord p) { return compare_nearest(p, vec2(0.0)); }
