#include "cascades/select.glsl"
out float visibility;

void main() {
    Receiver r = receiver_here();
    Choice c = cascade_of(r);
    visibility = visibility_at(r, c.coord);
    if (BLENDED == 1) visibility = mix(visibility_at(r, c.next), visibility, c.share);
}
