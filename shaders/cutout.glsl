// Where a cut-out surface is opaque, with the arithmetic of `Cutout.opaque`: filters of GPUs round their weights.
#include "triangle.glsl"
uniform usampler2D cutout_texels;  // α₈ of all cut-outs in turn, row by row, CUTOUT_ROW side by side
uniform isampler2D cutout_table;   // two texels each: first α₈, width, height, whether the nearest; wraps, least α₈ as bits

// Whole numbers as those of texels. In floats, as drivers on a CPU divide integers one by one.
vec2 wrapped(vec2 texel, vec2 size, ivec2 wraps) {
    vec2 period = size * mix(vec2(1.0), vec2(2.0), equal(wraps, ivec2(1)));
    vec2 inside = texel - period * floor((texel + 0.5) / period);
    inside = min(inside, 2.0 * size - 1.0 - inside);  // mirrored; a repeated one is below that
    inside = mix(inside, texel, equal(wraps, ivec2(2)));
    return clamp(inside, vec2(0.0), size - 1.0);
}

float alpha_of(ivec4 image, vec2 texel) {
    int index = image.x + int(texel.y) * image.y + int(texel.x);
    return float(texelFetch(cutout_texels, ivec2(index % CUTOUT_ROW, index / CUTOUT_ROW), 0).r);
}

bool is_opaque(int cutout, vec2 coordinates, float vertex_alpha) {
    ivec2 row = texel_of(cutout) * ivec2(2, 1);
    ivec4 image = texelFetch(cutout_table, row, 0), rest = texelFetch(cutout_table, row + ivec2(1, 0), 0);
    vec2 size = vec2(image.yz), at = coordinates * size;
    float alpha;
    if (image.w == 1) {
        alpha = alpha_of(image, wrapped(floor(at), size, rest.xy));
    } else {
        vec2 first = floor(at - 0.5), part = at - 0.5 - first;
        vec4 around = vec4(wrapped(first, size, rest.xy), wrapped(first + 1.0, size, rest.xy));
        float above = alpha_of(image, around.xy) * (1.0 - part.x) + alpha_of(image, around.zy) * part.x;
        float below = alpha_of(image, around.xw) * (1.0 - part.x) + alpha_of(image, around.zw) * part.x;
        alpha = above * (1.0 - part.y) + below * part.y;
    }
    return alpha * vertex_alpha >= intBitsToFloat(rest.z);
}
