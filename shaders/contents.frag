// Writes what the filter stores in the map besides depth.
#include "cutout.glsl"
#include "shadow_map.glsl"
in float linear_depth;  // see casters.vert
out vec4 contents;

void main() {
    cut_out();
    contents = filter_contents(linear_depth);
}
