// Twenty directions to the corners and the edge midpoints of a cube around the receiver, whose half side grows with the
// distance to the camera (de Vries, Learn OpenGL, "Point Shadows").
#define FILTER_HAS_RADIUS
uniform vec3 view_position;  // of the camera, of an orthographic one too
uniform float view_far;  // the camera's far plane
uniform float filter_spread;
uniform float filter_radius;
const float to_corner = sqrt(3.0);

float half_side(ShadowCoord p) {
    return filter_spread * (1.0 + distance(view_position, light.xyz - p.axis * p.axis_distance) / view_far);
}

// Radius in texels, a radius of 1 being a texel's diagonal: half a texel, plus the arc of the largest offset angle at
// the receiver's distance.
float radius(ShadowCoord p) {
    float angle = asin(min(to_corner * half_side(p) / p.axis_distance, 1.0));
    return filter_radius + angle * p.axis_distance / length(p.texel);
}

float filter_visibility(ShadowCoord p) {
    vec3 away = -p.axis * p.axis_distance;
    float side = half_side(p);
    float lit = 0.0;
    for (int x = -1; x <= 1; ++x)
        for (int y = -1; y <= 1; ++y)
            for (int z = -1; z <= 1; ++z) {
                if (x * x + y * y + z * z < 2) continue;
                float stored = textureLod(map_depths, away + side * vec3(x, y, z), 0.0).r;
                lit += p.depth - p.bias <= stored ? 1.0 : 0.0;
            }
    return lit / 20.0;
}
