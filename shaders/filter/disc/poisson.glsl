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
