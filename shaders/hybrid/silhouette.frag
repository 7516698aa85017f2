// Linear depth of an edge, unless a caster hides it from the light: unless it is behind all depths that are stored around it.
in vec3 point;  // on the edge
#ifdef MAP_CUBE
#include "cube_faces.glsl"
uniform samplerCube map_contents;
uniform vec3 light_position;
uniform float map_far;
uniform int face;

vec4 stored_around(vec2 texel) {
    return textureGather(map_contents, cube_faces[face] * vec3(2.0 * texel / float(SIZE) - 1.0, 1.0));
}
float depth() { return length(point - light_position) / map_far; }
#else
uniform sampler2D map_contents;
uniform vec4 caster_to_linear;

vec4 stored_around(vec2 texel) { return textureGather(map_contents, texel / float(SIZE)); }
float depth() { return dot(caster_to_linear, vec4(point, 1.0)); }
#endif

void main() {
    float nearest = depth() - fwidth(depth());  // within the texel
    vec4 farthest = vec4(-1e30);
    for (int corner = 0; corner < 4; ++corner)
        farthest = max(farthest, stored_around(gl_FragCoord.xy + vec2(corner % 2, corner / 2) - 0.5));
    if (nearest > max(max(farthest.x, farthest.y), max(farthest.z, farthest.w))) discard;
    gl_FragDepth = clamp(nearest, 0.0, 1.0);
}
