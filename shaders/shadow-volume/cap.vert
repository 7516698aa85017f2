// Corner of a cap, near or, with w = 0, at infinity; clipped by the near plane, as walls are not.
in vec4 point;
#include "shadow-volume/project.glsl"

void main() {
    gl_Position = clip_of(point);
    gl_ClipDistance[0] = gl_Position.z + gl_Position.w;
}
