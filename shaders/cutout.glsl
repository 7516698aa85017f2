// Where a cut-out surface is opaque, with the arithmetic of `Cutout.opaque`: filters of GPUs round their weights.
#include "triangle.glsl"
uniform usampler2D cutout_texels;  // α₈ of all cut-outs in turn, row by row, CUTOUT_ROW side by side
uniform isampler2D cutout_table;   // two texels each: first α₈, width, height, whether the nearest; wraps, least α₈ as bits

int wrapped(int index, int size, int wrap) {
    if (wrap == 2) return clamp(index, 0, size - 1);
    int period = wrap == 0 ? size : 2 * size;
    int inside = index < 0 ? period - 1 - (-1 - index) % period : index % period;
    return min(inside, 2 * size - 1 - inside);  // mirrored; a repeated one is below
}

float alpha_of(ivec4 image, ivec2 wraps, vec2 texel) {
    int index = image.x + wrapped(int(texel.x), image.y, wraps.x) + wrapped(int(texel.y), image.z, wraps.y) * image.y;
    return float(texelFetch(cutout_texels, ivec2(index % CUTOUT_ROW, index / CUTOUT_ROW), 0).r);
}

bool is_opaque(int cutout, vec2 coordinates, float vertex_alpha) {
    ivec2 row = texel_of(cutout) * ivec2(2, 1);
    ivec4 image = texelFetch(cutout_table, row, 0), rest = texelFetch(cutout_table, row + ivec2(1, 0), 0);
    vec2 at = coordinates * vec2(image.yz);
    float alpha;
    if (image.w == 1) {
        alpha = alpha_of(image, rest.xy, floor(at));
    } else {
        vec2 first = floor(at - 0.5), part = at - 0.5 - first;
        vec4 around;
        for (int i = 0; i < 4; ++i) around[i] = alpha_of(image, rest.xy, first + vec2(i % 2, i / 2));
        vec2 mixed = around.xz * (1.0 - part.x) + around.yw * part.x;
        alpha = mixed.x * (1.0 - part.y) + mixed.y * part.y;
    }
    return alpha * vertex_alpha >= intBitsToFloat(rest.z);
}
