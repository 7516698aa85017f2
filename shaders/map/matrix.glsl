// One map, or with ARRAY an array of maps, each projected by a matrix. PARALLEL: along parallel rays w is 1, and known to the
// compiler it saves all that depends on it; without, light rays may be parallel or not.
uniform mat4 world_to_map[LAYERS];
uniform mat4 map_to_world[LAYERS];     // its inverse
uniform vec4 world_to_linear[LAYERS];  // dot product with a position (w = 1) gives the linear depth
uniform vec2 texel_width[LAYERS];      // size of a texel in local lengths; for a spot at unit distance along its axis
uniform float depth_scale[LAYERS];     // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform vec3 light_axis;               // unit vector along the light's axis, pointing back to the light
#if ARRAY == 1
#define MAP_SAMPLER sampler2DArray
uniform sampler2DArrayShadow map_compare;  // the same maps with hardware comparison, 2×2 linear

vec3 in_layer(ShadowCoord p, vec2 uv) { return vec3(uv, p.layer); }
vec3 lookup(ShadowCoord p, vec2 offset) { return in_layer(p, p.uv + offset / map_size); }
float compared_at(vec3 at, float depth) { return texture(map_compare, vec4(at, depth)); }
#else
#define MAP_SAMPLER sampler2D
uniform sampler2DShadow map_compare;  // the same map with hardware comparison, 2×2 linear

vec2 in_layer(ShadowCoord p, vec2 uv) { return uv; }
vec2 lookup(ShadowCoord p, vec2 offset) { return in_layer(p, p.uv + offset / map_size); }
float compared_at(vec2 at, float depth) { return texture(map_compare, vec3(at, depth)); }
#endif
uniform MAP_SAMPLER map_depths;
const bool has_near_plane = true;

ShadowCoord projected(ShadowCoord p) {
    vec4 clip = world_to_map[p.layer] * vec4(p.position, 1.0);
    if (PARALLEL == 1) clip.w = 1.0;
    p.uv = clip.xy / clip.w;
    p.depth = clip.z / clip.w;
    p.axis = light_axis;
    p.axis_distance = clip.w;
    p.depth_per_length = depth_scale[p.layer] / (clip.w * clip.w);
    p.linear = dot(world_to_linear[p.layer], vec4(p.position, 1.0));
    p.linear_per_length = length(world_to_linear[p.layer].xyz);
    p.texel = texel_width[p.layer] * clip.w;
    return p;
}

float nearest_depth(ShadowCoord p, vec2 offset) {
    return textureLod(map_depths, in_layer(p, (floor(p.uv * map_size + offset) + 0.5) / map_size), 0.0).r;
}

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) { return compared_at(lookup(p, offset), depth); }

// Gradient of depth over uv on the receiver's plane: constant over the map, for a spot too. Planes transform by the inverse
// transpose.
vec2 plane_gradient(ShadowCoord p) {
    vec4 plane = vec4(p.receiver.normal, -dot(p.receiver.normal, p.receiver.position)) * map_to_world[p.layer];
    return plane.z == 0.0 ? vec2(0.0) : -plane.xy / plane.z;
}

vec3 to_texels(ShadowCoord p, vec4 v) { return (world_to_map[p.layer] * v).xyw * vec3(map_size, map_size, 1.0); }

// A spot's depth is affine in 1/w, w being the distance along the axis, and so is that of a plane over the map.
float plane_depth(ShadowCoord p, vec2 offset) {
    float change = depth_sign * dot(p.gradient, offset) / map_size;
    if (PARALLEL == 1 || light.w == 0.0) return p.linear + change;
    float w = 1.0 / max(1.0 / p.axis_distance - change / depth_scale[p.layer], 1e-3 / p.axis_distance);
    return p.linear + (w - p.axis_distance) * p.linear_per_length;
}

#if ON_PLANE == 1
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
#endif
