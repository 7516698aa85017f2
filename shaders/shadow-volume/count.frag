// The signed count of a volume's face for a blended colour target; the stencil ignores it.
#include "receiver.glsl"
uniform float front_adds;
out float count;

#if defined(WALL) && defined(COMPARE_POSITION)
#include "shadow-volume/behind.glsl"
uniform bool counted_behind;  // whether walls count behind the receiver, or in front of it
#endif

void main() {
#if defined(WALL) && defined(COMPARE_POSITION)
    vec3 receiver = texelFetch(surface_position, ivec2(gl_FragCoord.xy), 0).xyz;
    if (wall_is_behind(receiver) != counted_behind) discard;
#endif
    count = gl_FrontFacing ? front_adds : -front_adds;
}
