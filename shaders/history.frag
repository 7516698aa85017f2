// A technique's visibility, blended with that of the frames before at the same point.
#include "receiver.glsl"
#include <history>
uniform sampler2D drawn;  // what the technique drew
uniform sampler2D before; // where the pixels' surfaces were in the frame before
uniform sampler2D past;   // of the frame before: position, and visibility or −1
uniform mat4 past_clip;   // of its camera
uniform float past_pixel; // side of its pixels at unit depth
uniform float first;      // 1: there is no frame before
layout(location = 0) out float visibility;
layout(location = 1) out vec4 kept;

// The visibility that the frame before had at the receiver; −1 where it did not see it.
float history_of(Receiver r) {
    r.position = texelFetch(before, ivec2(gl_FragCoord.xy), 0).xyz;
    vec4 clip = past_clip * vec4(r.position, 1.0);
    if (first == 1.0 || clip.w <= 0.0) return -1.0;
    ivec2 size = textureSize(past, 0);
    // As fine as the weights of bilinear hardware, so that a camera at rest finds its own pixel exactly.
    vec2 at = round(((0.5 + 0.5 * clip.xy / clip.w) * vec2(size) - 0.5) * 256.0) / 256.0;
    ivec2 corner = ivec2(floor(at));
    vec2 right = at - vec2(corner), sum = vec2(0.0);
    for (int k = 0; k < 4; ++k) {
        ivec2 beside = ivec2(k & 1, k >> 1), pixel = corner + beside;
        if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, size))) continue;
        vec4 seen = texelFetch(past, pixel, 0);
        if (seen.w < 0.0 || abs(dot(r.normal, seen.xyz - r.position)) > past_pixel * clip.w) continue;
        vec2 weight = mix(1.0 - right, right, vec2(beside));
        sum += weight.x * weight.y * vec2(seen.w, 1.0);
    }
    return sum.y > 0.0 ? sum.x / sum.y : -1.0;
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver r = receiver_here();
    visibility = texelFetch(drawn, pixel, 0).r;
    if (r.facing) {
        float history = history_of(r);
        if (history >= 0.0) visibility = mix(history, visibility, share_of_frame(pixel));
    }
    kept = vec4(r.position, r.facing ? visibility : -1.0);
}
