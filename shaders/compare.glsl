// The two ways of comparing a receiver with 2-D maps; after the bias, which may bring a depth of its own to each texel.
#ifdef MAP_ARRAY
uniform sampler2DArray map_depths;
uniform sampler2DArrayShadow map_compare;
#define IN_LAYER(uv, p) vec3(uv, p.layer)
#define COMPARED(uv, p, depth) vec4(uv, p.layer, depth)
#else
uniform sampler2D map_depths;         // the depths themselves
uniform sampler2DShadow map_compare;  // the same map, compared and blended 2×2 by the hardware
#define IN_LAYER(uv, p) (uv)
#define COMPARED(uv, p, depth) vec3(uv, depth)
#endif

// Lit where the receiver, on its own plane above the texel's centre, is not behind the stored depth.
float lit_by(float stored, vec2 texel, MapPoint p) {
    // Clamped as the map's own depths are: a plane that runs past the far plane must not lie behind an empty texel, and
    // one that runs past the near plane not in front of the casters that are stored there.
    float depth = p.depth + dot(p.gradient, (texel + 0.5) / map_size - p.uv);
    float front = p.bias + depth_step;
    depth = REVERSED == 1 ? clamp(depth, 0.0, 1.0 - front) : clamp(depth, front, 1.0);
    return depth_sign * (depth - stored) <= p.bias ? 1.0 : 0.0;
}

// The one texel that holds uv, moved by an offset in texels.
float compare_nearest(MapPoint p, vec2 offset) {
    vec2 texel = floor(p.uv * map_size + offset);
    return lit_by(textureLod(map_depths, IN_LAYER((texel + 0.5) / map_size, p), 0.0).r, texel, p);
}

// Four texels around uv, weighted as a linear filter would.
float compare_linear(MapPoint p, vec2 offset) {
#ifdef BIAS_HAS_GRADIENT
    // Each texel has its own depth to compare with, which the hardware's comparison cannot know.
    vec2 at = p.uv * map_size + offset - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 stored = textureGather(map_depths, IN_LAYER((corner + 1.0) / map_size, p));
    float below = mix(lit_by(stored.w, corner, p), lit_by(stored.z, corner + vec2(1.0, 0.0), p), weight.x);
    float above = mix(lit_by(stored.x, corner + vec2(0.0, 1.0), p), lit_by(stored.y, corner + 1.0, p), weight.x);
    return mix(below, above, weight.y);
#else
    float depth = p.depth - depth_sign * p.bias;
    vec2 uv = p.uv + offset / map_size;
    return texture(map_compare, COMPARED(uv, p, depth));
#endif
}
