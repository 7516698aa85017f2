// Corner of a cap, near or, with w = 0, at infinity; clipped by the near plane, as walls are not.
in vec4 point;
flat out float near;  // 1, or 0 at infinity
#include "shadow-volume/project.glsl"

void main() {
    gl_Position = clip_of(point);
    near = point.w;
    gl_ClipDistance[0] = gl_Position.z + gl_Position.w;
}
