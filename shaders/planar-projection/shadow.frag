// A flattened caster, kept to the pixels of its plane: the G-buffer knows what is seen there, so no depth is compared.
#include "triangle.glsl"
uniform isampler2D surface_triangle;
uniform isampler2D plane_of_triangle;  // −1 on no plane
uniform int receiver;
out float visibility;

void main() {
    int triangle = texelFetch(surface_triangle, ivec2(gl_FragCoord.xy), 0).r;
    if (triangle < 0) discard;
    if (texelFetch(plane_of_triangle, texel_of(triangle), 0).r != receiver) discard;
    visibility = 0.0;
}
