// Blinn-Phong (Blinn 1977) with the visibility that a technique computed; ambient light is never shadowed.
#include "receiver.glsl"
#include "triangle.glsl"
uniform isampler2D surface_triangle;
uniform sampler2D colors;  // by triangle
uniform sampler2D visibility;
uniform sampler2D tint;  // what the technique wants to show of itself, of the picture's size; or one white texel
uniform vec3 eye;
uniform vec3 cone_axis;
uniform float cos_half_angle;
out vec4 color;

vec3 srgb(vec3 linear) {
    return mix(1.055 * pow(linear, vec3(1.0 / 2.4)) - 0.055, 12.92 * linear, lessThan(linear, vec3(0.0031308)));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver r = receiver_at(pixel);
    int triangle = texelFetch(surface_triangle, pixel, 0).r;
    if (triangle < 0) {
        color = vec4(srgb(vec3(0.35, 0.45, 0.6)), 1.0);
        return;
    }
    vec3 albedo = texelFetch(colors, texel_of(triangle), 0).rgb;
    albedo *= textureLod(tint, gl_FragCoord.xy / vec2(textureSize(visibility, 0)), 0.0).rgb;
    vec3 to_eye = normalize(eye - r.position);
    float lit = r.cosine > 0.0 && dot(-r.to_light, normalize(cone_axis)) >= cos_half_angle ? texelFetch(visibility, pixel, 0).r : 0.0;
    float diffuse = 0.85 * max(r.cosine, 0.0);
    float specular = 0.12 * pow(max(dot(r.normal, normalize(r.to_light + to_eye)), 0.0), 32.0);
    // More from above and from one side keeps unlit shapes readable: an unlit face of a box looks like no shadow.
    vec3 ambient = albedo * (0.12 + dot(r.normal, vec3(0.03, 0.06, -0.03)));
    color = vec4(srgb(clamp(ambient + lit * (albedo * diffuse + specular), 0.0, 1.0)), 1.0);
}
