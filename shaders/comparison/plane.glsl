// Each texel is compared with the receiver's plane at the texel's centre.

float compare(float stored, vec2 texel, ShadowCoord p) {
    // Clamped as stored depths are: beyond the far plane the receiver's plane must not be behind an empty texel, nor
    // before the near plane in front of casters clamped to it.
    float depth = stored_range(p.depth + dot(p.gradient, (texel + 0.5) / map_size - p.uv), p.bias + depth_step);
    return depth_sign * (depth - stored) <= p.bias ? 1.0 : 0.0;
}

float compare_nearest(ShadowCoord p, vec2 offset) {
    return compare(nearest_depth(p, offset), floor(p.uv * map_size + offset), p);
}

// Hardware comparison does not support different depths.
float compare_linear(ShadowCoord p, vec2 offset) {
    vec2 at = p.uv * map_size + offset - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 stored = textureGather(map_depths, lookup(p, corner + 1.0 - p.uv * map_size));
    float below = mix(compare(stored.w, corner, p), compare(stored.z, corner + vec2(1.0, 0.0), p), weight.x);
    float above = mix(compare(stored.x, corner + vec2(0.0, 1.0), p), compare(stored.y, corner + 1.0, p), weight.x);
    return mix(below, above, weight.y);
}
