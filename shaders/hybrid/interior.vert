// A cut-out triangle, whose texels are unsure as those of its edges.
in vec3 position;
out vec3 point;
#include "hybrid/silhouette/clip-<map>.glsl"

void main() {
    point = position;
    gl_Position = clip_of(position);
}
