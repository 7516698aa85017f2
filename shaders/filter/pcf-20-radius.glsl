#include "eye.glsl"
uniform float view_far;  // the camera's far plane
uniform float filter_spread;
uniform float filter_radius;
const float to_corner = sqrt(3.0);

float half_side(ShadowCoord p) {
    return filter_spread * (1.0 + distance(eye, light.xyz - p.axis * p.axis_distance) / view_far);
}

// Radius in texels, a radius of 1 being a texel's diagonal: half a texel, plus the arc of the largest offset angle at
// the receiver's distance.
float radius(ShadowCoord p) {
    float angle = asin(min(to_corner * half_side(p) / p.axis_distance, 1.0));
    return filter_radius + angle * p.axis_distance / length(p.texel);
}
