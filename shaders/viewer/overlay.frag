// What a pane shows: the shaded picture, or in its place, or over it, what explains it. OVERLAY_… chooses.
#include "receiver.glsl"
uniform sampler2D picture;     // sRGB
uniform sampler2D visibility;  // of the pane
uniform sampler2D truth;       // visibility; in y whether the pixel is scored, in z whether a smooth surface's own triangles shadow it
uniform sampler2D blocker;     // distance along L to the nearest occluder, as a share of the farthest; below 0 for none
uniform sampler2D texels;      // map coordinates in texels, and the layer; below 0 for none
uniform vec3 false_shadow, false_light, dark_facet;
uniform float soft;            // 1 under a light with a size, whose errors are small: the root is shown
out vec4 color;

vec3 ramp(float x) {  // dark blue, green, yellow
    return mix(mix(vec3(0.15, 0.15, 0.45), vec3(0.1, 0.6, 0.5), min(2.0 * x, 1.0)), vec3(1.0, 0.9, 0.25), max(2.0 * x - 1.0, 0.0));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 shown = texelFetch(picture, pixel, 0).rgb;
    Receiver r = receiver_at(pixel);
#if defined OVERLAY_ERROR
    vec3 right = texelFetch(truth, pixel, 0).xyz;
    float drawn = texelFetch(visibility, pixel, 0).r, error = right.y * (drawn - right.x);
    float strength = soft > 0.5 ? sqrt(abs(error)) : abs(error);
    shown = mix(mix(vec3(dot(shown, vec3(0.3, 0.6, 0.1))), shown, 0.5), error < 0.0 ? false_shadow : false_light, strength);
    shown = mix(shown, dark_facet, right.z * (1.0 - drawn));
#elif defined OVERLAY_MASK
    shown = vec3(texelFetch(visibility, pixel, 0).r);
#elif defined OVERLAY_NORMALS
    shown = texelFetch(surface_position, pixel, 0).w > 0.5 ? 0.5 + 0.5 * r.normal : shown;
#elif defined OVERLAY_COSINE
    shown = texelFetch(surface_position, pixel, 0).w > 0.5 ? (r.cosine > 0.0 ? vec3(r.cosine) : vec3(0.35, 0.0, 0.1)) : shown;
#elif defined OVERLAY_BLOCKERS
    float distance = texelFetch(blocker, pixel, 0).r;
    shown = distance < 0.0 ? 0.6 * shown + 0.2 : ramp(distance);
#elif defined OVERLAY_TEXELS
    // Each texel of the map in its place, where it covers pixels; where it is smaller, the picture is only paler.
    vec3 here = texelFetch(texels, pixel, 0).xyz;
    vec3 right = texelFetch(texels, min(pixel + ivec2(1, 0), textureSize(texels, 0) - 1), 0).xyz;
    vec3 above = texelFetch(texels, min(pixel + ivec2(0, 1), textureSize(texels, 0) - 1), 0).xyz;
    float pixels = 1.0 / max(max(distance(here.xy, right.xy), distance(here.xy, above.xy)), 1e-6);  // along a texel
    bool even = mod(floor(here.x) + floor(here.y), 2.0) < 0.5;
    bool border = any(notEqual(floor(here), floor(right))) || any(notEqual(floor(here), floor(above)));
    vec3 grid = border && pixels > 6.0 ? vec3(0.1) : even ? vec3(0.95, 0.75, 0.3) : vec3(0.2, 0.35, 0.6);
    shown = mix(shown, here.z < 0.0 ? vec3(0.3) : pixels < 1.5 ? vec3(0.9) : grid, here.z < 0.0 || pixels < 1.5 ? 0.35 : 0.5);
#endif
    color = vec4(shown, 1.0);
}
