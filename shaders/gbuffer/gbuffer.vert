// G-buffer pass: position, geometric normal and triangle index of the visible surface of every pixel.
#include "cutout.glsl"
in vec3 position;
uniform mat4 world_to_clip;
uniform vec4 world_to_depth;  // w of the clip space of a perspective; parallel rays have none
out vec3 world;
out float view_depth;

void main() {
    pass_cutout();
    world = position;
    gl_Position = world_to_clip * vec4(position, 1.0);
    view_depth = world_to_depth.x * position.x + world_to_depth.y * position.y + world_to_depth.z * position.z + world_to_depth.w;
}
