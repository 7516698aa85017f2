// Shadow mapping (Williams 1978) with percentage-closer filtering (Reeves, Salesin and Cook 1987): the receiver is moved
// and its depth biased, then compared with stored depths, as many and with such weights as the filter has.
#include "map.glsl"
#include "bias.glsl"
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
float compare(float stored, vec2 texel, ShadowCoord p) {
    // Clamped as the map's own depths are: a plane that runs past the far plane must not lie behind an empty texel, and
    // one that runs past the near plane not in front of the casters that are stored there.
    float depth = p.depth + dot(p.gradient, (texel + 0.5) / map_size - p.uv);
    float front = p.bias + depth_step;
    depth = REVERSED == 1 ? clamp(depth, 0.0, 1.0 - front) : clamp(depth, front, 1.0);
    return depth_sign * (depth - stored) <= p.bias ? 1.0 : 0.0;
}

// The one texel that holds uv, moved by an offset in texels.
float compare_nearest(ShadowCoord p, vec2 offset) {
    vec2 texel = floor(p.uv * map_size + offset);
    return compare(textureLod(map_depths, IN_LAYER((texel + 0.5) / map_size, p), 0.0).r, texel, p);
}

// Four texels around uv, weighted as a linear filter would.
float compare_linear(ShadowCoord p, vec2 offset) {
#ifdef BIAS_HAS_GRADIENT
    // Each texel has its own depth to compare with, which the hardware's comparison cannot know.
    vec2 at = p.uv * map_size + offset - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 stored = textureGather(map_depths, IN_LAYER((corner + 1.0) / map_size, p));
    float below = mix(compare(stored.w, corner, p), compare(stored.z, corner + vec2(1.0, 0.0), p), weight.x);
    float above = mix(compare(stored.x, corner + vec2(0.0, 1.0), p), compare(stored.y, corner + 1.0, p), weight.x);
    return mix(below, above, weight.y);
#else
    float depth = p.depth - depth_sign * p.bias;
    vec2 uv = p.uv + offset / map_size;
    return texture(map_compare, COMPARED(uv, p, depth));
#endif
}

#include <filter>

// Visibility of a receiver by one layer. Every pixel of a quad must call it: a bias may take screen derivatives.
float map_visibility(Receiver r, int layer) {
    ShadowCoord p = shadow_coord(r.position, layer);
    p = shadow_coord(r.position + bias_offset(r, p), layer);
    // Casters in front of near are stored at near itself; a bias larger than the receiver's depth would see past them.
    float room = REVERSED == 1 ? 1.0 - p.depth : p.depth;
    p.bias = min(bias_depth(r, p), max(room - depth_step, 0.0));
    p.gradient = bias_gradient(r, p);
    if (!r.facing || p.axis_distance <= 0.0) return 1.0;
    float beyond = REVERSED == 1 ? -p.depth : p.depth - 1.0;
#ifdef FAR_RULE_NONE
    // Fixed-point maps clamp the compared depth; said here, so that all formats agree.
    if (beyond - p.bias > 0.0) return 0.0;
#else
    if (beyond > 0.0) return 1.0;
#endif
    return filter_visibility(p);
}
