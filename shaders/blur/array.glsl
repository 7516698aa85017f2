uniform sampler2DArray source;

vec4 source_texel(vec2 uv) { return textureLod(source, vec3(uv, layer), 0.0); }
