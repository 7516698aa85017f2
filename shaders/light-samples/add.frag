// Adds one point of the light: its weight as each receiver sees it, and the weight times the visibility of the point.
// A point's share of the light's solid angle is n·−ω/d² of its share of the surface (n the light's normal there).
// The `light` of receiver.glsl is the point.
#include "receiver.glsl"
uniform sampler2D visibility;  // of the point
uniform vec3 light_normal;
out vec2 sums;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver r = receiver_here();
    float weight = light.w == 0.0 ? 1.0 : max(dot(light_normal, -r.to_light), 0.0) / (r.distance * r.distance);
    if (!r.facing) weight = 0.0;
    sums = weight * vec2(texelFetch(visibility, pixel, 0).r, 1.0);
}
