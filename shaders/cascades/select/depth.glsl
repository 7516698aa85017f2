// By view depth.
uniform vec4 view_depth;         // dot product with a position (w = 1) gives the depth along the camera's axis
uniform float starts[LAYERS];    // view depths at which each cascade begins
uniform float ends[LAYERS];      // and ends

Choice cascade_of(Receiver r) {
    float depth = dot(view_depth, vec4(r.position, 1.0));
    int layer = 0;
    while (layer < LAYERS - 1 && depth > ends[layer]) ++layer;
    ShadowCoord p = shadow_coord(r, layer);
    float length = max(ends[layer] - starts[layer], 1e-30);  // slices of a fixed split may be empty
    float border_distance = (ends[layer] - depth) / length;
    if (BLENDED == 0 || layer + 1 == LAYERS || border_distance >= blend) return Choice(p, p, 1.0);
    return Choice(p, shadow_coord(r, layer + 1), max(border_distance / blend, 0.0));
}
