#include "triangle.glsl"
#include "cutout.glsl"
#include "gbuffer/surface.glsl"
in vec3 world;
in float view_depth;
uniform float far;
layout(location = 0) out vec4 surface_position;
layout(location = 2) out int surface_triangle;

void main() {
    cut_out();
    surface_position = vec4(world, 1.0);
    surface_triangle = triangle_here();
    write_surface(surface_triangle, world);
    // Linear, because hyperbolic depth cannot resolve distant surfaces of a deep scene.
    gl_FragDepth = view_depth / far;
}
