// One direction of a separable blur of a map's layer: along its rows, from the map into `TAPS - 1` more rows than the layer
// has, or along the columns of that, back into the map.
uniform float weights[TAPS];
uniform int layer;
out vec4 blurred;
const int reach = TAPS / 2;

// Defines vec4 blurred_texel(vec2 at, int i), the i-th of the texels from -reach to reach that a blurred texel is made of.
#include "blur/<blur>.glsl"

void main() {
    vec2 at = floor(gl_FragCoord.xy);
    blurred = vec4(0.0);
    for (int i = -reach; i <= reach; ++i) blurred += weights[i + reach] * blurred_texel(at, i);
}
