#include "cube_faces.glsl"
uniform samplerCube map_contents;
uniform vec3 light_position;
uniform float map_far;
uniform int face;

vec4 stored_around(vec2 texel) {
    return textureGather(map_contents, cube_faces[face] * vec3(2.0 * texel / float(SIZE) - 1.0, 1.0));
}
float depth() { return length(point - light_position) / map_far; }
