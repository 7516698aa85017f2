// Percentage-closer filtering (Reeves, Salesin and Cook 1987) over n×n texels, equally weighted.
#ifdef HARDWARE_DEPTH
float filter_visibility(ShadowCoord p) {
    const int reach = (FILTER_TAPS - 1) / 2;
    float lit = 0.0;
    for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) lit += compare_nearest(p, vec2(x, y));
    return lit / float(FILTER_TAPS * FILTER_TAPS);
}
#else
const int quads = (FILTER_TAPS + 1) / 2;  // of four texels, along a side

vec2 quad_at(int i) {  // in floats, as drivers on a CPU divide integers one by one
    float row = floor((float(i) + 0.5) / float(quads));
    return 2.0 * vec2(float(i) - row * float(quads), row);
}

// The sum over four texels; its texels beyond the last column and row do not count.
float sum_of(vec4 lit, vec2 at) {
    vec2 inside = vec2(lessThan(at, vec2(float(FILTER_TAPS - 1))));
    return lit.x + inside.x * lit.y + inside.y * (lit.z + inside.x * lit.w);
}

float filter_visibility(ShadowCoord p) {
    vec2 first = floor(p.uv * map_size) - float((FILTER_TAPS - 1) / 2);
    float lit = 0.0;
    int unsure = 0;
    for (int i = 0; i < quads * quads; ++i) {
        vec4 sure = sure_around(p, first + quad_at(i));
        if (any(equal(sure, vec4(0.5)))) unsure |= 1 << i;
        else lit += sum_of(sure, quad_at(i));
    }
    for (; unsure != 0; unsure &= unsure - 1) {  // a loop, which processors without branches leave too
        vec2 at = quad_at(findLSB(unsure));
        lit += sum_of(lit_around(p, first + at), at);
    }
    return lit / float(FILTER_TAPS * FILTER_TAPS);
}
#endif
