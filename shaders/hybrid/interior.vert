// A cut-out triangle.
#include "cutout.glsl"
in vec3 position;
out vec3 point;
#include "hybrid/silhouette/clip-<map>.glsl"

void main() {
    point = position;
    pass_cutout();
    gl_Position = clip_of(position);
}
