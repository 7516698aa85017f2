// Visibility from the number of shadow volumes that contain the receiver.
#include "receiver.glsl"
#ifdef COLOR
uniform sampler2D counts;
#endif
out float visibility;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#ifdef COLOR
    bool inside = texelFetch(counts, pixel, 0).r != 0.0;
#else
    bool inside = true;  // by the stencil test
#endif
    visibility = receiver_here().facing && inside ? 0.0 : 1.0;
}
