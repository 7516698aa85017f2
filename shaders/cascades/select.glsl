// Selection of a receiver's cascade, nearest and finest first. Needs LAYERS, and BLENDED: 1 if cascades fade into the next.
#include "shadow_map.glsl"
uniform float blend;  // width of the border that fades into the next cascade, as a share of a cascade

struct Choice {
    ShadowCoord coord;  // in its layer
    ShadowCoord next;   // in the layer to blend with, or coord itself
    float share;        // blend weight of coord; next has the rest
};

// Defines Choice cascade_of(Receiver r); its points are not biased yet.
#include "cascades/select/<select>.glsl"
