// Percentage-closer filtering over a disc of a fixed radius.
#include "filter/disc.glsl"
uniform float filter_width;

float filter_visibility(ShadowCoord p) {
    mat2 turned = turn();
    float lit = 0.0;
    for (int i = 0; i < FILTER_TAPS; ++i) lit += compare_linear(p, filter_width * turned * disc_point(i, FILTER_TAPS));
    return lit / float(FILTER_TAPS);
}
