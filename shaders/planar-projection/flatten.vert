// Casters flattened onto a plane as seen from a light (Blinn 1988), in the camera's image.
in vec3 position;
uniform mat4 flattened_to_clip;  // view-projection · ((π·l) I − l πᵀ)
uniform vec4 plane;              // π, a unit normal turned to the light
uniform vec4 light;              // w = 0: unit vector towards it; w = 1: its position
uniform float clearance;
out float gl_ClipDistance[1];

void main() {
    // The light itself is flattened to nothing, so that it may be subtracted first, before rounding.
    // What is above a lamp has a negative w after it and leaves the view volume: in front of the camera by that w,
    // behind it, where both signs turn, beyond the far plane.
    gl_Position = flattened_to_clip * vec4(position - light.w * light.xyz, 1.0 - light.w);
    gl_ClipDistance[0] = dot(plane, vec4(position, 1.0)) - clearance;
}
