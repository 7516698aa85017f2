// Points of a disc of radius 1.
#define FILTER_HAS_PLANE

// Turn of the pattern at this pixel (Jimenez 2014, interleaved gradient noise).
float turn() {
#if FILTER_ROTATE
    return 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
#else
    return 0.0;
#endif
}

// The i-th of `count` points, each with the same share of the disc's area.
vec2 disc_point(int i, int count, float turn) {
    float angle = 2.3999632 * float(i) + turn;  // the golden angle
    return sqrt((float(i) + 0.5) / float(count)) * vec2(cos(angle), sin(angle));
}
