// Percentage-closer filtering over a disc of a fixed radius.
#include "filter/disc.glsl"
uniform float filter_width;

float filter_visibility(ShadowCoord p) {
    float turned = turn(), lit = 0.0;
    for (int i = 0; i < FILTER_TAPS; ++i) lit += compare_linear(p, filter_width * disc_point(i, FILTER_TAPS, turned));
    return lit / float(FILTER_TAPS);
}
