// Four taps in a pattern that alternates with the pixel's parity (Bunnell and Pellacini 2004).
uniform float filter_width;

float filter_visibility(ShadowCoord p) {
#ifdef FILTER_UNIT_MAP
    float w = filter_width * map_size / 1000.0;  // thousandths of the map's side, as published
#else
    float w = filter_width;
#endif
    vec2 o = mod(floor(gl_FragCoord.xy), 2.0) * w;
    return 0.25 * (compare_linear(p, vec2(-1.5 * w + o.x, 1.5 * w - o.y)) + compare_linear(p, vec2(-1.5 * w + o.x, -0.5 * w - o.y))
                 + compare_linear(p, vec2(0.5 * w + o.x, 1.5 * w - o.y)) + compare_linear(p, vec2(0.5 * w + o.x, -0.5 * w - o.y)));
}
