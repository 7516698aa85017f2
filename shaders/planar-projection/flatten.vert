// Casters projected from the light onto a plane (Blinn 1988), in the camera's clip space.
#include "cutout.glsl"
in vec3 position;
uniform vec3 center;             // of the scene: subtracted first, as large coordinates would lose precision below
uniform mat4 flattened_to_clip;  // view-projection · ((π·l) I − l πᵀ), for positions relative to the centre
uniform vec4 plane;              // π with a unit normal towards the light, for positions relative to the centre
uniform float clearance;         // casters closer to the plane are clipped, a local length
out float gl_ClipDistance[1];

void main() {
    pass_cutout();
    vec4 point = vec4(position - center, 1.0);
    // Points above a spot or point light get a negative w from the projection, and are clipped: in front of the camera by
    // that w, behind it, where both signs change, by the far plane.
    gl_Position = flattened_to_clip * point;
    gl_ClipDistance[0] = dot(plane, point) - clearance;
}
