// Twenty directions to the corners and the edge midpoints of a cube around the receiver, whose half side grows with the
// distance to the camera (de Vries, Learn OpenGL, "Point Shadows").
#include "filter/pcf-20-radius.glsl"

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
