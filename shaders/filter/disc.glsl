// Points of a disc of radius 1.
#define FILTER_HAS_PLANE

// Turn of the pattern at this pixel, by interleaved gradient noise (Jimenez 2014).
mat2 turn() {
#if FILTER_ROTATE
    float angle = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    return mat2(cos(angle), sin(angle), -sin(angle), cos(angle));
#else
    return mat2(1.0);
#endif
}

// The i-th of `count` points, each with the same share of the disc's area: the golden angle from one to the next.
vec2 disc_point(int i, int count) {
    float angle = 2.3999632 * float(i);
    return sqrt((float(i) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}
