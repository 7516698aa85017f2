// Reads one map.
#define MAP_SAMPLER sampler2D
uniform MAP_SAMPLER map_depths;
uniform sampler2DShadow map_compare;  // the same map with hardware comparison, 2×2 linear

vec2 lookup(ShadowCoord p, vec2 offset) { return p.uv + offset / map_size; }

float nearest_depth(ShadowCoord p, vec2 offset) {
    return textureLod(map_depths, (floor(p.uv * map_size + offset) + 0.5) / map_size, 0.0).r;
}

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) {
    return texture(map_compare, vec3(lookup(p, offset), depth));
}
