// What a G-buffer of instances has of the triangles that are visible.
#include "triangle.glsl"
#include "gbuffer/surface.glsl"
uniform sampler2D drawn_position;
uniform isampler2D drawn_triangle;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 position = texelFetch(drawn_position, pixel, 0);
    if (position.w == 0.0) discard;
    write_surface(texelFetch(drawn_triangle, pixel, 0).r, position.xyz);
}
