uniform sampler2D map_contents;
uniform vec4 caster_to_linear;

vec4 stored_around(vec2 texel) { return textureGather(map_contents, texel / float(SIZE)); }
float depth() { return dot(caster_to_linear, vec4(point, 1.0)); }
