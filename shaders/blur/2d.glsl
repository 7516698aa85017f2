uniform sampler2D source;

vec4 source_texel(vec2 uv) { return textureLod(source, uv, 0.0); }
