uniform sampler2DArray source;

vec4 blurred_texel(vec2 at, int i) { return texelFetch(source, ivec3(at + vec2(0, i + reach), layer), 0); }
