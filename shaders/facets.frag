// Darkens what the triangles hide from the light although the smooth surface faces it: pixels of no receiver, where
// techniques leave 1.
#include "shading_normal.glsl"
out float visibility;

void main() {
    Receiver r = receiver_here();
    // Where the light lies in the triangle's plane, the sign of N·L is that of a rounding error, another on each device.
    if (!r.receives || r.cosine > 1e-6 || dot(shading_normal(r), r.to_light) <= 0.0) discard;
    visibility = 0.0;
}
