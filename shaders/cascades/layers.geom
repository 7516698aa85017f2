// Draws all layers at once: each invocation emits the triangle into its layer unless it is outside the layer's window.
layout(triangles, invocations = LAYERS) in;
layout(triangle_strip, max_vertices = 3) out;
#include "cutout.glsl"
in vec3 world[];
out float linear_depth;  // as in casters.vert
uniform mat4 world_to_clip[LAYERS];
uniform vec4 caster_to_linear[LAYERS];

void main() {
    vec4 corners[3];
    for (int i = 0; i < 3; ++i) corners[i] = world_to_clip[gl_InvocationID] * vec4(world[i], 1.0);
    // All corners outside one side of the window: clipping would remove the triangle.
    vec2 least = min(min(corners[0].xy, corners[1].xy), corners[2].xy);
    vec2 most = max(max(corners[0].xy, corners[1].xy), corners[2].xy);
    if (any(greaterThan(least, vec2(1.0))) || any(lessThan(most, vec2(-1.0)))) return;
    for (int i = 0; i < 3; ++i) {
        pass_cutout(i);
        gl_Position = corners[i];
        linear_depth = dot(caster_to_linear[gl_InvocationID], vec4(world[i], 1.0));
        gl_Layer = gl_InvocationID;
        EmitVertex();
    }
    EndPrimitive();
}
