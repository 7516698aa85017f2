// Writes depth only.
#include "cutout.glsl"
#include "gradient.glsl"

void main() {
    store_gradient();  // first, as derivatives need all four fragments
    cut_out();
}
