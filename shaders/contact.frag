// A technique's visibility, with contact shadows on top.
#include "receiver.glsl"
#include <contact>
uniform sampler2D drawn;  // what the technique drew
out float visibility;

void main() {
    Receiver r = receiver_here();
    visibility = texelFetch(drawn, ivec2(gl_FragCoord.xy), 0).r;
    if (r.facing && visibility > 0.0) visibility *= 1.0 - contact_shadow(r);
}
