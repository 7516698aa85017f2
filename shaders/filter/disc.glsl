// Points of a disc of radius 1.
const float golden_angle = 2.3999632;

mat2 rotation(float angle) { return mat2(cos(angle), sin(angle), -sin(angle), cos(angle)); }

// Turn of the pattern at this pixel, by interleaved gradient noise (Jimenez 2014).
mat2 turn() {
    if (FILTER_ROTATE == 0) return mat2(1.0);
    return rotation(6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))));
}

// Defines vec2 disc_point(int i, int count).
#include "filter/disc/<filter_pattern>.glsl"
