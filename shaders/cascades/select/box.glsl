// The first cascade whose box contains the receiver.
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
    ShadowCoord p = shadow_coord(r, LAYERS - 1);
    Choice c = Choice(p, p, 1.0);
    bool contained = border_distance(bias(p)) >= 0.0;
    for (int layer = LAYERS - 2; layer >= 0; --layer) {  // a loop that compilers unroll: layer indexes uniforms
        p = shadow_coord(r, layer);
        float own = border_distance(bias(p));
        if (own < 0.0) continue;
        c.share = BLENDED == 1 && contained ? min(own / blend, 1.0) : 1.0;
        c.next = c.share < 1.0 ? c.coord : p;
        c.coord = p;
        contained = true;
    }
    return c;
}
