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
const float quads = float((FILTER_TAPS + 1) / 2);  // of four texels, along a side

// The sum over four texels; its texels beyond the last column and row do not count.
float sum_of(vec4 lit, vec2 at) {
    vec2 inside = vec2(lessThan(at, vec2(float(FILTER_TAPS - 1))));
    return lit.x + inside.x * lit.y + inside.y * (lit.z + inside.x * lit.w);
}

float filter_visibility(ShadowCoord p) {
    vec2 first = floor(p.uv * map_size) - float((FILTER_TAPS - 1) / 2);
    float lit = 0.0;
    int rest = 0, quad = 1;
    for (float y = 0.0; y < float(FILTER_TAPS); y += 2.0)
        for (float x = 0.0; x < float(FILTER_TAPS); x += 2.0, quad <<= 1) {
            float sum = sum_of(sure_around(p, first + vec2(x, y)), vec2(x, y));
            rest |= sum < unsure ? 0 : quad;
            lit += sum < unsure ? sum : 0.0;
        }
#ifdef TEXEL_SURE
    // A loop of one texel a turn, as processors without branches leave loops too, after one turn more. In floats, as
    // drivers on a CPU divide integers one by one.
    for (int i = 0; rest != 0; rest = i == 3 ? rest & rest - 1 : rest, i = (i + 1) & 3) {
        float at_quad = float(findLSB(rest)), row = floor((at_quad + 0.5) / quads);
        vec2 at = 2.0 * vec2(at_quad - row * quads, row) + vec2(i & 1, i >> 1);
        if (max(at.x, at.y) < float(FILTER_TAPS))
            lit += float(texel_lit(p, nearest_texel(p, first + 0.5 + at - p.uv * map_size)));
    }
#endif
    return lit / float(FILTER_TAPS * FILTER_TAPS);
}
#endif
