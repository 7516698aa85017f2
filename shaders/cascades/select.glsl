// Selection of a receiver's cascade, nearest and finest first. Needs LAYERS, and BLENDED: 1 if cascades fade into the next.
#include "shadow_map.glsl"
uniform float blend;  // width of the border that fades into the next cascade, as a share of a cascade

struct Choice {
    ShadowCoord coord;  // in its layer, biased
    ShadowCoord next;   // in the layer to blend with, or coord itself
    float share;        // blend weight of coord; next has the rest
};

ShadowCoord biased(Receiver r, int layer) { return bias(shadow_coord(r, layer)); }

// Defines Choice cascade_of(Receiver r).
#include "cascades/select/<select>.glsl"
