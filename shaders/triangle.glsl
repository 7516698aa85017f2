// Where a texture by triangle has what belongs to one; its width is TRIANGLE_ROW.
ivec2 texel_of(int triangle) {
    return ivec2(triangle % TRIANGLE_ROW, triangle / TRIANGLE_ROW);
}
