// Writes depth only.
#include "cutout/fragment.glsl"

void main() { cut_out(); }
