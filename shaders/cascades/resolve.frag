#include "cascades/select.glsl"
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    Choice c = cascade_of(r);
    visibility = map_visibility(r, c.layer);
    // A uniform condition, so that all pixels of a quad make the call, which may take screen derivatives.
    if (blend > 0.0) visibility = mix(map_visibility(r, c.next), visibility, c.share);
}
