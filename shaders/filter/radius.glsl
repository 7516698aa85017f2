uniform float filter_radius;

float radius(ShadowCoord p) { return filter_radius; }
