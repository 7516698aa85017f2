// Debug colours: a colour for each cascade.
#include "cascades/select.glsl"
out vec4 tint;

const vec3 colors[8] = vec3[8](
    vec3(1.0, 0.35, 0.35), vec3(0.35, 1.0, 0.35), vec3(0.4, 0.5, 1.0), vec3(1.0, 1.0, 0.35),
    vec3(1.0, 0.4, 1.0), vec3(0.35, 1.0, 1.0), vec3(1.0, 0.65, 0.25), vec3(0.7, 0.7, 0.7));

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Choice c = cascade_of(receiver_here());
    bool hit = texelFetch(surface_position, pixel, 0).w > 0.5;
    tint = vec4(hit ? mix(colors[c.next.layer], colors[c.coord.layer], c.share) : vec3(1.0), 1.0);
}
