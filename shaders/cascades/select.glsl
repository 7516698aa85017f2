// Selection of a receiver's cascade, nearest and finest first. Needs LAYERS and SELECT_BOX or SELECT_DEPTH.
#include "shadow_map.glsl"
uniform float blend;  // width of the border that fades into the next cascade, as a share of a cascade

struct Choice {
    int layer;
    int next;     // the cascade to blend with, or layer itself
    float share;  // blend weight of layer; next has the rest
};

// border_distance: of the receiver from the border of layer, as a share of the cascade.
Choice blended(int layer, int next, float border_distance) {
    if (next == LAYERS || border_distance >= blend) return Choice(layer, layer, 1.0);
    return Choice(layer, next, max(border_distance / blend, 0.0));
}

#ifdef SELECT_DEPTH
uniform vec4 view_depth;         // dot product with a position (w = 1) gives the depth along the camera's axis
uniform float starts[LAYERS];    // view depths at which each cascade begins
uniform float ends[LAYERS];      // and ends

Choice cascade_of(Receiver r) {
    float depth = dot(view_depth, vec4(r.position, 1.0));
    int layer = 0;
    while (layer < LAYERS - 1 && depth > ends[layer]) ++layer;
    float length = max(ends[layer] - starts[layer], 1e-30);  // slices of a fixed split may be empty
    return blended(layer, layer + 1, (ends[layer] - depth) / length);
}
#else
uniform float filter_margin;         // distance from a receiver to a texel that is read, in texels
uniform vec4 light_margin[LAYERS];   // what is added around the receivers for lights with a size: low and high uv

// Distance of the offset receiver from the border of a layer's box, less the filter radius, as a share of the box;
// negative outside.
float border_distance(Receiver r, int layer) {
    ShadowCoord p = shadow_coord(r.position, layer);
    p = shadow_coord(r.position + bias_offset(r, p), layer);
    vec3 position = vec3(p.uv, p.depth);
    vec3 low = vec3(light_margin[layer].xy, 0.0), high = vec3(light_margin[layer].zw, 0.0);
    vec3 margin = min(position - low, 1.0 - position - high) - vec3(vec2(filter_margin / map_size), 0.0);
    return min(margin.x, min(margin.y, margin.z));
}

// The first layer from `layer` on whose box contains the receiver; LAYERS if none does.
int first_containing(Receiver r, int layer) {
    while (layer < LAYERS && border_distance(r, layer) < 0.0) ++layer;
    return layer;
}

Choice cascade_of(Receiver r) {
    int layer = min(first_containing(r, 0), LAYERS - 1);
    return blended(layer, first_containing(r, layer + 1), border_distance(r, layer));
}
#endif
