// Casters flattened onto a plane as seen from a light (Blinn 1988), in the camera's image.
in vec3 position;
uniform vec3 center;             // of the scene: what is far from the origin loses its last digits before they matter
uniform mat4 flattened_to_clip;  // view-projection · ((π·l) I − l πᵀ), of points from the centre
uniform vec4 plane;              // π, a unit normal turned to the light, of points from the centre
uniform float clearance;
out float gl_ClipDistance[1];

void main() {
    vec4 point = vec4(position - center, 1.0);
    // What is above a lamp has a negative w after it and leaves the view volume: in front of the camera by that w,
    // behind it, where both signs turn, beyond the far plane.
    gl_Position = flattened_to_clip * point;
    gl_ClipDistance[0] = dot(plane, point) - clearance;
}
