#include "cube_faces.glsl"
uniform samplerCube source;

vec4 source_texel(vec2 uv) { return textureLod(source, cube_faces[layer] * vec3(2.0 * uv - 1.0, 1.0), 0.0); }
