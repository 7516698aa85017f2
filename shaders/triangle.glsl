// The texel of a triangle in a texture of per-triangle data, TRIANGLE_ROW texels wide.
ivec2 texel_of(int triangle) {
    return ivec2(triangle % TRIANGLE_ROW, triangle / TRIANGLE_ROW);
}
