// One direction of a separable blur of a map's layer. ROWS: along its rows, from the map into `TAPS - 1` more rows than the
// layer has; else along the columns of that, back into the map.
#ifdef MAP_CUBE
#include "cube_faces.glsl"
#endif
uniform float weights[TAPS];
uniform int layer;
#if defined(ROWS) && defined(MAP_CUBE)
uniform samplerCube source;
#elif defined(ROWS) && !defined(MAP_ARRAY)
uniform sampler2D source;
#else
uniform sampler2DArray source;
#endif
out vec4 blurred;
const int reach = TAPS / 2;

// The texel at integer coordinates of the layer, past its edges too.
vec4 texel(vec2 at) {
#ifndef ROWS
    return texelFetch(source, ivec3(at, layer), 0);
#else
    vec2 uv = (at + 0.5) / float(SIZE);
#ifdef MAP_CUBE
    return textureLod(source, cube_faces[layer] * vec3(2.0 * uv - 1.0, 1.0), 0.0);
#elif defined(MAP_ARRAY)
    return textureLod(source, vec3(uv, layer), 0.0);
#else
    return textureLod(source, uv, 0.0);
#endif
#endif
}

void main() {
    vec2 at = floor(gl_FragCoord.xy);
    blurred = vec4(0.0);
    for (int i = -reach; i <= reach; ++i)
#ifdef ROWS
        blurred += weights[i + reach] * texel(at + vec2(i, -reach));
#else
        blurred += weights[i + reach] * texel(at + vec2(0, i + reach));
#endif
}
