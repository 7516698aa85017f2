#include "cascades/select.glsl"
out float visibility;

void main() {
    Choice c = cascade_of(receiver_here());
    visibility = lit(c.coord);
    if (BLENDED == 1) visibility = mix(lit(c.next), visibility, c.share);
}
