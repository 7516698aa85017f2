// Points of a disc of radius 1.
#ifndef FILTER_PLANE
#define FILTER_PLANE 1
#endif
#if FILTER_PLANE
#define FILTER_HAS_PLANE
#endif
const float golden_angle = 2.3999632;

mat2 rotation(float angle) { return mat2(cos(angle), sin(angle), -sin(angle), cos(angle)); }

// Turn of the pattern at this pixel, by interleaved gradient noise (Jimenez 2014).
mat2 turn() {
#if FILTER_ROTATE
    return rotation(6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715)))));
#else
    return mat2(1.0);
#endif
}

#ifdef FILTER_PATTERN_POISSON
// Dart throwing with no two points nearer than 0.26, the best of many sets; ordered so that the first points, too, are as
// far apart and cover the disc as evenly as they can: the first n are nowhere nearer than 1.2/sqrt(n).
const vec2 poisson_disc[32] = vec2[](
    vec2(0.021, 0.848), vec2(-0.102, -0.679), vec2(0.481, 0.133), vec2(-0.892, 0.145), vec2(0.624, -0.645),
    vec2(-0.142, -0.007), vec2(-0.446, 0.489), vec2(0.306, -0.294), vec2(-0.608, -0.652), vec2(0.517, 0.767),
    vec2(0.846, -0.155), vec2(-0.515, -0.148), vec2(0.21, 0.393), vec2(-0.254, -0.381), vec2(0.15, -0.943),
    vec2(-0.319, 0.858), vec2(0.763, 0.33), vec2(-0.769, -0.317), vec2(-0.273, 0.248), vec2(0.012, -0.235),
    vec2(0.333, -0.685), vec2(-0.026, 0.545), vec2(0.516, 0.495), vec2(0.584, -0.315), vec2(-0.687, 0.324),
    vec2(0.261, 0.679), vec2(-0.389, -0.811), vec2(0.095, -0.497), vec2(-0.64, 0.676), vec2(0.209, 0.129),
    vec2(0.865, -0.421), vec2(-0.983, -0.104));

// The i-th point. Points beyond the table repeat it, turned by the golden angle, as near to others as chance has it.
vec2 disc_point(int i, int count) { return rotation(golden_angle * float(i / 32)) * poisson_disc[i % 32]; }
#else
// The i-th of `count` points, each with the same share of the disc's area: the golden angle from one to the next.
vec2 disc_point(int i, int count) {
    return sqrt((float(i) + 0.5) / float(count)) * rotation(golden_angle * float(i))[0];
}
#endif
