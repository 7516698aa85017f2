// What a map stores of the triangle in each texel, with GRADIENTS: the gradient of its stored depth per texel, or in a cube
// map that of the inverse of its distance along the face's axis, as a share of it. It holds past the triangle's edges.
// Two floats of which the upper half is kept: packHalf2x16 is newer, and takes longer.
#if GRADIENTS == 1
layout(location = CONTENTS) out uint gradient;

void store_gradient() {
#if CUBE == 1
    vec2 slope = vec2(dFdx(gl_FragCoord.w), dFdy(gl_FragCoord.w)) / gl_FragCoord.w;
#else
    vec2 slope = vec2(dFdx(gl_FragCoord.z), dFdy(gl_FragCoord.z));
    if (clamp(gl_FragCoord.z, 0.0, 1.0) != gl_FragCoord.z) slope = vec2(0.0);  // stored at the near plane
#endif
    uvec2 rounded = floatBitsToUint(slope) + 0x8000u;
    gradient = rounded.x >> 16 | rounded.y & 0xFFFF0000u;
}
#else
void store_gradient() {}
#endif
