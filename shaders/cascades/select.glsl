// Which cascade answers a receiver, nearest and finest first. Needs LAYERS and SELECT_BOX or SELECT_DEPTH.
#include "shadow_map.glsl"
uniform float blend;  // share of a cascade, at its border, that fades into the next

struct Choice {
    int layer;
    int next;     // the same where there is none
    float share;  // of layer, the rest being next's
};

Choice faded(int layer, int next, float room) {
    if (next == LAYERS || room >= blend) return Choice(layer, layer, 1.0);
    return Choice(layer, next, max(room / blend, 0.0));
}

#ifdef SELECT_DEPTH
uniform vec4 view_depth;         // of a position, w = 1, along the camera's axis
uniform float starts[LAYERS];    // view depths between which a cascade answers
uniform float ends[LAYERS];

Choice cascade_of(Receiver r) {
    float depth = dot(view_depth, vec4(r.position, 1.0));
    int layer = 0;
    while (layer < LAYERS - 1 && depth > ends[layer]) ++layer;
    float length = max(ends[layer] - starts[layer], 1e-30);  // a fixed split may leave slices empty
    return faded(layer, layer + 1, (ends[layer] - depth) / length);
}
#else
// How far inside a layer's box the point lies where the bias moves it, less the filter's reach, as a share of the box.
float room_in(Receiver r, int layer) {
    ShadowCoord p = shadow_coord(r.position, layer);
    p = shadow_coord(r.position + bias_offset(r, p), layer);
    vec3 at = vec3(p.uv, p.depth);
    vec3 room = min(at, 1.0 - at) - vec3(vec2(filter_radius / map_size), 0.0);
    return min(room.x, min(room.y, room.z));
}

int first_that_holds(Receiver r, int layer) {
    while (layer < LAYERS && room_in(r, layer) < 0.0) ++layer;
    return layer;
}

Choice cascade_of(Receiver r) {
    int layer = min(first_that_holds(r, 0), LAYERS - 1);
    return faded(layer, first_that_holds(r, layer + 1), room_in(r, layer));
}
#endif
