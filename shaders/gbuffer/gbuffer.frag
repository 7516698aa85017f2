#include "triangle.glsl"
#include "cutout/fragment.glsl"
#include "gbuffer/smooth.glsl"
in vec3 world;
in float view_depth;
uniform sampler2D normals;  // by triangle; w = 1 for triangles that receive shadows
uniform vec3 eye;
uniform float far;
layout(location = 0) out vec4 surface_position;
layout(location = 1) out vec4 surface_normal;
layout(location = 2) out int surface_triangle;

void main() {
    cut_out();
    // Read per triangle: screen derivatives of the position are wrong at silhouettes.
    vec4 normal = texelFetch(normals, texel_of(triangle_here()), 0);
    surface_position = vec4(world, 1.0);
    surface_normal = vec4(dot(normal.xyz, eye - world) < 0.0 ? -normal.xyz : normal.xyz, normal.w);
    surface_triangle = triangle_here();
    write_smooth_surface(surface_triangle, world, surface_normal);
    // Linear, because hyperbolic depth cannot resolve distant surfaces of a deep scene.
    gl_FragDepth = view_depth / far;
}
