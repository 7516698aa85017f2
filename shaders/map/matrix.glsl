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
#define GRADIENT_SAMPLER usampler2DArray
uniform sampler2DArrayShadow map_compare;  // the same maps with hardware comparison, 2×2 linear

vec3 in_layer(ShadowCoord p, vec2 uv) { return vec3(uv, p.layer); }
vec3 lookup(ShadowCoord p, vec2 offset) { return in_layer(p, p.uv + offset / map_size); }
float compared_at(vec3 at, float depth) { return texture(map_compare, vec4(at, depth)); }
#else
#define MAP_SAMPLER sampler2D
#define GRADIENT_SAMPLER usampler2D
uniform sampler2DShadow map_compare;  // the same map with hardware comparison, 2×2 linear

vec2 in_layer(ShadowCoord p, vec2 uv) { return uv; }
vec2 lookup(ShadowCoord p, vec2 offset) { return in_layer(p, p.uv + offset / map_size); }
float compared_at(vec2 at, float depth) { return texture(map_compare, vec3(at, depth)); }
#endif
uniform MAP_SAMPLER map_depths;
#if GRADIENTS == 1
uniform GRADIENT_SAMPLER map_gradients;
#endif
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

Texel nearest_texel(ShadowCoord p, vec2 offset) {
    vec2 at = (floor(p.uv * map_size + offset) + 0.5) / map_size;
    Texel t = Texel(textureLod(map_depths, in_layer(p, at), 0.0).r, offset, vec2(0.0));
#if GRADIENTS == 1
    t.gradient = unpacked(textureLod(map_gradients, in_layer(p, at), 0.0).r);
#endif
    return t;
}

Texel[4] texels_around(ShadowCoord p, vec2 corner) {
    vec2 from = corner + 0.5 - p.uv * map_size;
    vec4 stored = textureGather(map_depths, in_layer(p, (corner + 1.0) / map_size));
    Texel t[4] = Texel[4](Texel(stored.w, from, vec2(0.0)), Texel(stored.z, from + vec2(1.0, 0.0), vec2(0.0)),
                          Texel(stored.x, from + vec2(0.0, 1.0), vec2(0.0)), Texel(stored.y, from + 1.0, vec2(0.0)));
#if GRADIENTS == 1
    uvec4 slopes = textureGather(map_gradients, in_layer(p, (corner + 1.0) / map_size));
    t[0].gradient = unpacked(slopes.w);
    t[1].gradient = unpacked(slopes.z);
    t[2].gradient = unpacked(slopes.x);
    t[3].gradient = unpacked(slopes.y);
#endif
    return t;
}

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) { return compared_at(lookup(p, offset), depth); }

// Gradient of depth over uv on the receiver's plane: constant over the map, for a spot too. Planes transform by the inverse
// transpose.
vec2 plane_gradient(ShadowCoord p) {
    float height = PARALLEL == 1 ? 0.0 : dot(p.receiver.normal, p.receiver.position);
    vec4 plane = vec4(p.receiver.normal, -height) * map_to_world[p.layer];
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

float receiver_change(ShadowCoord p, Texel t) { return dot(p.gradient / map_size, t.offset); }
float caster_change(ShadowCoord p, Texel t) { return dot(t.gradient, t.offset); }
