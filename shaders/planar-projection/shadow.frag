// A projected caster, restricted to the pixels whose G-buffer triangle is part of the plane; needs no depth test.
#include "triangle.glsl"
#include "cutout.glsl"
uniform isampler2D surface_triangle;
uniform isampler2D plane_of_triangle;  // −1 for none
uniform int receiver;
out float visibility;

void main() {
    cut_out();
    int triangle = texelFetch(surface_triangle, ivec2(gl_FragCoord.xy), 0).r;
    if (triangle < 0) discard;
    if (texelFetch(plane_of_triangle, texel_of(triangle), 0).r != receiver) discard;
    visibility = 0.0;
}
