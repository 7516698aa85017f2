// Writes what the filter stores in the map besides depth.
#include "cutout.glsl"
#include "gradient.glsl"
#include "shadow_map.glsl"
in float linear_depth;  // see casters.vert
layout(location = 0) out vec4 contents;

void main() {
    store_gradient();
    cut_out();
    contents = filter_contents(linear_depth);
}
