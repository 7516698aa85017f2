// Adds some points of the light: their weight as each receiver sees them, and the weight of those with no caster before them.
#include "receiver.glsl"
uniform sampler2D center_counts;  // layers before the light's centre
uniform sampler2D counts;         // see count.frag
uniform vec3 points[POINTS];
uniform vec3 normals[POINTS];  // of the light's surface
uniform int used;
out vec2 sums;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver r = receiver_here();
    float layers = texelFetch(center_counts, pixel, 0).r;
    vec4 rest = texelFetch(counts, pixel, 0);
    sums = vec2(0.0);
    for (int k = 0; k < used; ++k) {
        float digit = mod(rest[k / 4] + 32.0, 64.0) - 32.0;
        rest[k / 4] = (rest[k / 4] - digit) / 64.0;
        vec3 to = points[k] - light.w * r.position;
        if (dot(to, r.normal) <= 0.0) continue;
        float squared = dot(to, to);
        float weight = light.w == 0.0 ? 1.0 : max(dot(normals[k], -to), 0.0) / (squared * sqrt(squared));
        sums += weight * vec2(layers + digit == 0.0 ? 1.0 : 0.0, 1.0);
    }
}
