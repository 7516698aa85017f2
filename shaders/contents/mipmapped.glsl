#include "eye.glsl"
uniform vec3 forward;
uniform vec3 pixel_right;  // from one pixel's ray to the next, at unit depth
uniform vec3 pixel_up;

// The offset in texels on the receiver's plane from one pixel to the next: derivatives of the G-buffer are wrong at
// silhouettes, where they span two surfaces.
vec2 footprint(ShadowCoord p, vec3 pixel) {
    vec3 away = p.position - eye;
    vec3 ray = away / dot(away, forward) + pixel;
    float along = dot(p.receiver.normal, ray), height = dot(p.receiver.normal, away);
    // A plane seen edge-on: at most to twice the distance.
    float reach = along * height > 0.0 ? min(height / along, 2.0 * dot(away, forward)) : 2.0 * dot(away, forward);
    vec3 texels = to_texels(p, vec4(eye + ray * reach, 1.0));
    return texels.xy / texels.z - p.uv * map_size;
}

// The mean over the pixel's footprint, by up to 8 samples along its longer side. Levels are mixed here since llvmpipe
// returns wrong values in quads of which only some pixels need a level above 0.
vec4 contents_at(ShadowCoord p, vec2 offset) {
    vec2 right = footprint(p, pixel_right), up = footprint(p, pixel_up);
    vec2 longer = dot(right, right) > dot(up, up) ? right : up;
    float side = max(length(longer), 1e-6), other = min(length(right), length(up));
    float samples = clamp(ceil(side / max(other, 1.0)), 1.0, 8.0);
    float level = max(log2(max(side / samples, other)), 0.0);
    vec4 sum = vec4(0.0);
    for (float i = 0.5; i < samples; ++i) {
        vec2 at = offset + longer * (i / samples - 0.5);
        sum += mix(contents_of_level(p, at, floor(level)), contents_of_level(p, at, ceil(level)), fract(level));
    }
    return sum / samples;
}
