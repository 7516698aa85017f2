#include "cascades/select.glsl"
out float visibility;

void main() {
    Choice c = cascade_of(receiver_here());
    visibility = lit(bias(c.coord));
    if (BLENDED == 1) visibility = mix(lit(bias(c.next)), visibility, c.share);
}
