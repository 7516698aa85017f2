// The normal of a triangle at a point of it, and the smooth surface that it stands for.
#include "gbuffer/smooth.glsl"
uniform sampler2D normals;  // by triangle; w = 1 for triangles that receive shadows
uniform vec4 eye;      // w = 0: towards it, of parallel rays; w = 1: its position
layout(location = 1) out vec4 surface_normal;

void write_surface(int triangle, vec3 world) {
    // Read per triangle: screen derivatives of the position are wrong at silhouettes.
    vec4 normal = texelFetch(normals, texel_of(triangle), 0);
    surface_normal = vec4(dot(normal.xyz, eye.xyz - eye.w * world) < 0.0 ? -normal.xyz : normal.xyz, normal.w);
    write_smooth_surface(triangle, world, surface_normal);
}
