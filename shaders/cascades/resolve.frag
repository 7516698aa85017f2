#include "cascades/select.glsl"
out float visibility;

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    Choice c = cascade_of(r);
    visibility = map_visibility(r, c.layer);
    // The condition is a uniform's, so that all pixels of a quad call.
    if (blend > 0.0) visibility = mix(map_visibility(r, c.next), visibility, c.share);
}
