// Optimised percentage-closer filtering (Castaño 2013, "Shadow Mapping Summary, Part 1"): a separable kernel by few bilinear
// comparisons. Two neighbouring texels of weights a and b are one comparison of weight a + b at the distance b/(a + b).
struct Taps {
#if FILTER_TAPS == 3
    vec2 at, weight;
#else
    vec3 at, weight;
#endif
};

// Comparisons along one axis, at offsets from the receiver's point, which is s texels past a texel's centre. Together they
// weight the texels as a kernel of the whole texels, 1 2 1 or 1 3 4 3 1, interpolated linearly.
Taps taps(float s) {
#if FILTER_TAPS == 3
    vec2 weight = vec2(3.0 - 2.0 * s, 1.0 + 2.0 * s);
    return Taps(vec2(-1.0, 1.0) + vec2(2.0 - s, s) / weight - s, weight);
#else
    vec3 weight = vec3(4.0 - 3.0 * s, 7.0, 1.0 + 3.0 * s);
    return Taps(vec3(-2.0, 0.0, 2.0) + vec3(3.0 - 2.0 * s, 3.0 + s, s) / weight - s, weight);
#endif
}

float filter_visibility(ShadowCoord p) {
    const int count = (FILTER_TAPS + 1) / 2;
    vec2 s = fract(p.uv * map_size - 0.5);
    Taps across = taps(s.x), up = taps(s.y);
    float lit = 0.0, sum = 0.0;
    for (int y = 0; y < count; ++y)
        for (int x = 0; x < count; ++x) {
            float weight = across.weight[x] * up.weight[y];
            lit += weight * compare_linear(p, vec2(across.at[x], up.at[y]));
            sum += weight;
        }
    return lit < sum ? min(lit / sum, 1.0) : 1.0;  // by a quotient alone, rounding would leave lit texels in shadow
}
