// The share of the light that each receiver sees; a receiver is what faces the light's centre.
#include "receiver.glsl"
uniform sampler2D sums;  // see add.frag
out float visibility;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 sum = texelFetch(sums, pixel, 0).rg;
    visibility = receiver_here().facing && sum.y > 0.0 ? min(sum.x / sum.y, 1.0) : 1.0;
}
