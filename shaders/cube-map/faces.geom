// Emits a triangle into each face whose pyramid it may intersect.
layout(triangles, invocations = 6) in;
layout(triangle_strip, max_vertices = 3) out;
#include "cube_faces.glsl"
#include "cutout.glsl"
in vec3 from_light[];
out vec3 away;

void main() {
    vec4 corners[3];
    for (int i = 0; i < 3; ++i) corners[i] = project(gl_InvocationID, from_light[i]);
    // All corners outside one side of the face's pyramid: clipping would remove the triangle.
    vec3 x = vec3(corners[0].x, corners[1].x, corners[2].x), y = vec3(corners[0].y, corners[1].y, corners[2].y);
    vec3 w = vec3(corners[0].w, corners[1].w, corners[2].w);
    if (all(greaterThan(x, w)) || all(lessThan(x, -w)) || all(greaterThan(y, w)) || all(lessThan(y, -w))) return;
    for (int i = 0; i < 3; ++i) {
        pass_cutout(i);
        away = from_light[i];
        gl_Position = corners[i];
        gl_Layer = gl_InvocationID;
        EmitVertex();
    }
    EndPrimitive();
}
