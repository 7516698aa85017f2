// Selection of a receiver's cascade, nearest and finest first. Needs LAYERS, SELECT_BOX or SELECT_DEPTH, and BLENDED: 1 if
// cascades fade into the next.
#include "shadow_map.glsl"
uniform float blend;  // width of the border that fades into the next cascade, as a share of a cascade

struct Choice {
    ShadowCoord coord;  // in its layer
    ShadowCoord next;   // in the layer to blend with, or coord itself
    float share;        // blend weight of coord; next has the rest
};

#ifdef SELECT_DEPTH
uniform vec4 view_depth;         // dot product with a position (w = 1) gives the depth along the camera's axis
uniform float starts[LAYERS];    // view depths at which each cascade begins
uniform float ends[LAYERS];      // and ends

Choice cascade_of(Receiver r) {
    float depth = dot(view_depth, vec4(r.position, 1.0));
    int layer = 0;
    while (layer < LAYERS - 1 && depth > ends[layer]) ++layer;
    ShadowCoord p = offset_coord(r, layer);
    float length = max(ends[layer] - starts[layer], 1e-30);  // slices of a fixed split may be empty
    float border_distance = (ends[layer] - depth) / length;
    if (BLENDED == 0 || layer + 1 == LAYERS || border_distance >= blend) return Choice(p, p, 1.0);
    return Choice(p, offset_coord(r, layer + 1), max(border_distance / blend, 0.0));
}
#else
uniform float filter_margin;         // distance from a receiver to a texel that is read, in texels
uniform vec4 light_margin[LAYERS];   // what is added around the receivers for lights with a size: low and high uv

// Distance of the offset receiver from the border of its layer's box, less the filter radius, as a share of the box;
// negative outside.
float border_distance(ShadowCoord p) {
    vec3 position = vec3(p.uv, p.depth);
    vec3 low = vec3(light_margin[p.layer].xy, 0.0), high = vec3(light_margin[p.layer].zw, 0.0);
    vec3 margin = min(position - low, 1.0 - position - high) - vec3(vec2(filter_margin / map_size), 0.0);
    return min(margin.x, min(margin.y, margin.z));
}

// The first layer whose box contains the receiver, or the last layer; next, the second that does.
Choice cascade_of(Receiver r) {
    ShadowCoord p = offset_coord(r, LAYERS - 1);
    Choice c = Choice(p, p, 1.0);
    float distance = border_distance(p);
    bool contained = distance >= 0.0;
    for (int layer = LAYERS - 2; layer >= 0; --layer) {  // a loop that compilers unroll: layer indexes uniforms
        p = offset_coord(r, layer);
        float own = border_distance(p);
        if (own < 0.0) continue;
        c.share = BLENDED == 1 && contained ? min(own / blend, 1.0) : 1.0;
        c.next = c.share < 1.0 ? c.coord : p;
        c.coord = p;
        contained = true;
    }
    return c;
}
#endif
