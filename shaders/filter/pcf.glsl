// Percentage-closer filtering (Reeves, Salesin and Cook 1987) over n×n texels, equally weighted.
float filter_visibility(ShadowCoord p) {
    const int reach = (FILTER_TAPS - 1) / 2;
    float lit = 0.0;
    for (int y = -reach; y <= reach; ++y)
        for (int x = -reach; x <= reach; ++x) lit += compare_nearest(p, vec2(x, y));
    return lit / float(FILTER_TAPS * FILTER_TAPS);
}
