// The signed count of a volume's face for a blended colour target; the stencil ignores it.
flat in float weight;
uniform float front_adds;
out float count;

#if defined(WALL) && defined(COMPARE_POSITION)
#include "receiver.glsl"
#include "shadow-volume/behind.glsl"
flat in vec3 edge_a;
flat in vec3 edge_b;
#ifdef COUNT_Z_FAIL
const bool counted_behind = true;
#else
const bool counted_behind = false;
#endif
#endif

void main() {
#if defined(WALL) && defined(COMPARE_POSITION)
    vec3 receiver = texelFetch(surface_position, ivec2(gl_FragCoord.xy), 0).xyz;
    if (wall_is_behind(edge_a, edge_b, receiver) != counted_behind) discard;
#endif
    count = gl_FrontFacing ? front_adds * weight : -front_adds * weight;
}
