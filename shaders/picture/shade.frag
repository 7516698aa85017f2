// Blinn-Phong (Blinn 1977) with the visibility that a technique computed, over hemisphere ambient light, which is never
// shadowed: a shadow takes the sky's tint, and shapes inside it stay readable.
#include "shading_normal.glsl"
#include "triangle.glsl"
uniform isampler2D surface_triangle;
uniform sampler2D colors;  // by triangle
uniform sampler2D visibility;
uniform sampler2D tint;  // what the technique wants to show of itself, of the picture's size; or one white texel
uniform vec4 eye;
uniform vec3 cone_axis;
uniform float cos_half_angle;
const float specular = 0.12, shininess = 32.0;  // coefficient and exponent of the highlight
const vec3 light_color = vec3(0.86, 0.82, 0.76);
const vec3 sky = vec3(0.13, 0.17, 0.25), ground = vec3(0.085, 0.075, 0.06);  // ambient light from above and from below
const vec3 horizon = vec3(0.28, 0.36, 0.46), zenith = vec3(0.11, 0.18, 0.32);  // behind the scene; white is for what is lit
out vec4 color;

vec3 srgb(vec3 linear) {
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThan(linear, vec3(0.0031308)));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec2 place = gl_FragCoord.xy / vec2(textureSize(visibility, 0));
    Receiver r = receiver_here();
    int triangle = texelFetch(surface_triangle, pixel, 0).r;
    if (triangle < 0) {
        color = vec4(srgb(mix(horizon, zenith, place.y)), 1.0);
        return;
    }
    vec3 albedo = texelFetch(colors, texel_of(triangle), 0).rgb * textureLod(tint, place, 0.0).rgb;
    vec3 to_eye = normalize(eye.xyz - eye.w * r.position);
    vec3 normal = shading_normal(r);
    float cosine = dot(normal, r.to_light);
    float lit = cosine > 0.0 && dot(-r.to_light, normalize(cone_axis)) >= cos_half_angle ? texelFetch(visibility, pixel, 0).r : 0.0;
    float highlight = specular * pow(max(dot(normal, normalize(r.to_light + to_eye)), 0.0), shininess);
    // Two walls look alike to a hemisphere: a little more light from one side tells them apart.
    vec3 around = mix(ground, sky, 0.5 + 0.5 * normal.y) * (1.0 + dot(normal, vec3(0.25, 0.0, -0.25)));
    vec3 direct = lit * light_color * (albedo * max(cosine, 0.0) + highlight);
    color = vec4(srgb(clamp(albedo * around + direct, 0.0, 1.0)), 1.0);
}
