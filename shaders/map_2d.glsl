// A 2-D depth map and the two ways of comparing with it. Needs SIZE, and REVERSED 0 or 1.
// All depths are the map's own, in [0, 1], growing towards the light where REVERSED.
#include "receiver.glsl"
uniform sampler2D map_depths;         // the depths themselves
uniform sampler2DShadow map_compare;  // the same map, compared and blended 2×2 by the hardware
uniform mat4 world_to_map;
uniform mat4 map_to_world;
uniform vec2 texel_width;  // local lengths of a texel; for a spot at unit distance along its axis
uniform float depth_scale; // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform float depth_step;  // spacing of stored depths near 1

const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;
const float map_size = float(SIZE);

struct MapPoint {
    vec2 uv;
    float depth;
    float axis_distance;     // along the light's axis; 1 for a directional light
    float depth_per_length;  // towards the light, in local lengths
    vec2 texel;              // local lengths of a texel at the receiver
    float bias;              // subtracted from the depth, in depth units
    vec2 gradient;           // of the receiver's depth over uv
};

MapPoint map_point(vec3 position, float light_distance) {
    MapPoint p;
    vec4 projected = world_to_map * vec4(position, 1.0);
    p.uv = projected.xy / projected.w;
    p.depth = projected.z / projected.w;
    p.axis_distance = projected.w;
    p.depth_per_length = depth_scale / (projected.w * light_distance);
    p.texel = texel_width * projected.w;
    p.bias = 0.0;
    p.gradient = vec2(0.0);
    return p;
}

// Lit where the receiver, on its own plane above the texel's centre, is not behind the stored depth.
float lit_by(float stored, vec2 texel, MapPoint p) {
    float depth = p.depth + dot(p.gradient, (texel + 0.5) / map_size - p.uv);
    return depth_sign * (depth - stored) <= p.bias ? 1.0 : 0.0;
}

// The one texel that holds uv, moved by an offset in texels.
float compare_nearest(MapPoint p, vec2 offset) {
    vec2 texel = floor(p.uv * map_size + offset);
    return lit_by(textureLod(map_depths, (texel + 0.5) / map_size, 0.0).r, texel, p);
}

// Four texels around uv, weighted as a linear filter would.
float compare_linear(MapPoint p, vec2 offset) {
#ifdef BIAS_HAS_GRADIENT
    // Each texel has its own depth to compare with, which the hardware's comparison cannot know.
    vec2 at = p.uv * map_size + offset - 0.5;
    vec2 corner = floor(at);
    vec2 weight = at - corner;
    vec4 stored = textureGather(map_depths, (corner + 1.0) / map_size);
    float below = mix(lit_by(stored.w, corner, p), lit_by(stored.z, corner + vec2(1.0, 0.0), p), weight.x);
    float above = mix(lit_by(stored.x, corner + vec2(0.0, 1.0), p), lit_by(stored.y, corner + 1.0, p), weight.x);
    return mix(below, above, weight.y);
#else
    return texture(map_compare, vec3(p.uv + offset / map_size, p.depth - depth_sign * p.bias));
#endif
}
