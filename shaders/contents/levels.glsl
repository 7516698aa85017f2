uniform MAP_SAMPLER map_contents;  // what the filter stored, blurred

vec4 contents_of_level(ShadowCoord p, vec2 offset, float level) { return textureLod(map_contents, lookup(p, offset), level); }
