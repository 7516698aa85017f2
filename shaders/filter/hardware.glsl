float filter_visibility(MapPoint p) { return compare_linear(p, vec2(0.0)); }
