float filter_visibility(MapPoint p) { return compare_nearest(p, vec2(0.0)); }
