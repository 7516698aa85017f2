// Reads a cube map. Offsets past a face's edge read the neighbouring face.
#define MAP_SAMPLER samplerCube
uniform MAP_SAMPLER map_depths;
uniform samplerCubeShadow map_compare;  // the same map with hardware comparison, 2×2 linear, seamless at edges

vec3 lookup(ShadowCoord p, vec2 offset) {
    return cube_faces[p.layer] * vec3(offset * p.texel, 0.0) - p.axis * p.axis_distance;
}

float nearest_depth(ShadowCoord p, vec2 offset) { return textureLod(map_depths, lookup(p, offset), 0.0).r; }

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) {
    return texture(map_compare, vec4(lookup(p, offset), depth));
}
