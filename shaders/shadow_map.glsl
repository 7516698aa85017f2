// Shadow mapping (Williams 1978) with percentage-closer filtering (Reeves, Salesin and Cook 1987): the receiver is offset,
// its depth biased and compared with the stored depths, and the results are weighted by the filter.
#include "map.glsl"
#include "bias.glsl"
#ifdef MAP_ARRAY
#define MAP_SAMPLER sampler2DArray
uniform sampler2DArrayShadow map_compare;
#define IN_LAYER(uv, p) vec3(uv, p.layer)
#define COMPARED(uv, p, depth) vec4(uv, p.layer, depth)
#else
#define MAP_SAMPLER sampler2D
uniform sampler2DShadow map_compare;  // the same map with hardware comparison, 2×2 linear
#define IN_LAYER(uv, p) (uv)
#define COMPARED(uv, p, depth) vec3(uv, depth)
#endif
uniform MAP_SAMPLER map_depths;
#ifdef FILTER_CONTENTS
uniform MAP_SAMPLER map_contents;
#endif

#include "filter.glsl"

// 1 unless the receiver's plane, at the texel's centre, is behind the stored depth.
float compare(float stored, vec2 texel, ShadowCoord p) {
    // Clamped as stored depths are: beyond the far plane the receiver's plane must not be behind an empty texel, nor
    // before the near plane in front of casters clamped to it.
    float depth = p.depth + dot(p.gradient, (texel + 0.5) / map_size - p.uv);
    float front = p.bias + depth_step;
    depth = REVERSED == 1 ? clamp(depth, 0.0, 1.0 - front) : clamp(depth, front, 1.0);
    return depth_sign * (depth - stored) <= p.bias ? 1.0 : 0.0;
}

// The texel at uv plus an offset in texels.
float compare_nearest(ShadowCoord p, vec2 offset) {
    vec2 texel = floor(p.uv * map_size + offset);
    return compare(textureLod(map_depths, IN_LAYER((texel + 0.5) / map_size, p), 0.0).r, texel, p);
}

vec4 four_texels(MAP_SAMPLER map, ShadowCoord p, vec2 texel) {
    return textureGather(map, IN_LAYER((texel + 1.0) / map_size, p));
}

// Four texels around uv plus an offset in texels, with bilinear weights.
float compare_linear(ShadowCoord p, vec2 offset) {
#if defined(BIAS_HAS_GRADIENT) || defined(FILTER_HAS_PLANE)
    // Each texel is compared with a different depth, which hardware comparison does not support.
    vec2 at = p.uv * map_size + offset - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 stored = four_texels(map_depths, p, corner);
    float below = mix(compare(stored.w, corner, p), compare(stored.z, corner + vec2(1.0, 0.0), p), weight.x);
    float above = mix(compare(stored.x, corner + vec2(0.0, 1.0), p), compare(stored.y, corner + 1.0, p), weight.x);
    return mix(below, above, weight.y);
#else
    float depth = p.depth - depth_sign * p.bias;
    vec2 uv = p.uv + offset / map_size;
    return texture(map_compare, COMPARED(uv, p, depth));
#endif
}

// A spot's depth is affine in 1/w, w being the distance along the axis, and so is that of a plane over the map.
float plane_depth(ShadowCoord p, vec2 offset) {
    float change = depth_sign * dot(p.gradient, offset) / map_size;
    if (light.w == 0.0) return p.linear + change;
    float w = 1.0 / max(1.0 / p.axis_distance - change / depth_scale[p.layer], 1e-3 / p.axis_distance);
    return p.linear + (w - p.axis_distance) * p.linear_per_length;
}

vec3 to_texels(ShadowCoord p, vec4 v) { return (world_to_map[p.layer] * v).xyw * vec3(map_size, map_size, 1.0); }

#ifdef FILTER_CONTENTS
vec4 contents_of_level(ShadowCoord p, vec2 offset, float level) {
    return textureLod(map_contents, IN_LAYER(p.uv + offset / map_size, p), level);
}
#endif

// Of the receiver as offset by the bias.
ShadowCoord offset_coord(Receiver r, int layer) {
    return shadow_coord(r.position + bias_offset(r, shadow_coord(r.position, layer)), layer);
}

// Visibility of a receiver at its offset_coord. All pixels of a quad must call it, as a bias may take screen derivatives.
float visibility_at(Receiver r, ShadowCoord p) {
    p.normal = r.normal;
    // Casters in front of the near plane are stored at near; a bias larger than the receiver's depth would miss them.
    float from_near = REVERSED == 1 ? 1.0 - p.depth : p.depth;
    p.bias = min(bias_depth(r, p), max(from_near - depth_step, 0.0));
    p.linear -= p.bias / p.depth_per_length * p.linear_per_length;
#if defined(FILTER_HAS_PLANE) && !defined(BIAS_HAS_GRADIENT)
    p.gradient = plane_gradient(r, p);
#else
    p.gradient = bias_gradient(r, p);
#endif
    if (!r.facing || p.axis_distance <= 0.0) return 1.0;
    float beyond = REVERSED == 1 ? -p.depth : p.depth - 1.0;
#ifdef FAR_RULE_NONE
    // Explicit, as fixed-point formats clamp the compared depth and float formats do not.
    if (beyond - p.bias > 0.0) return 0.0;
#else
    if (beyond > 0.0) return 1.0;
#endif
    return filter_visibility(p);
}

// Visibility of a receiver in one layer.
float map_visibility(Receiver r, int layer) { return visibility_at(r, offset_coord(r, layer)); }
