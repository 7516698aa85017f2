// The texels of a row at texture coordinates of the layer, past its edges too.
#include "blur/<map>.glsl"

vec4 blurred_texel(vec2 at, int i) { return source_texel((at + vec2(i, -reach) + 0.5) / float(SIZE)); }
