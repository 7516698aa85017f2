// Reads a layer of an array of maps.
#define MAP_SAMPLER sampler2DArray
uniform MAP_SAMPLER map_depths;
uniform sampler2DArrayShadow map_compare;  // the same maps with hardware comparison, 2×2 linear

vec3 lookup(ShadowCoord p, vec2 offset) { return vec3(p.uv + offset / map_size, p.layer); }

float nearest_depth(ShadowCoord p, vec2 offset) {
    return textureLod(map_depths, vec3((floor(p.uv * map_size + offset) + 0.5) / map_size, p.layer), 0.0).r;
}

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) {
    return texture(map_compare, vec4(lookup(p, offset), depth));
}
