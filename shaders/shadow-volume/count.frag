// The signed count of a volume's face for a blended colour target; the stencil ignores it.
#include "receiver.glsl"
uniform float front_adds;
out float count;

#if defined(WALL) && defined(COMPARE_POSITION)
#include "shadow-volume/behind.glsl"
uniform bool counted_behind;  // whether walls count behind the receiver, or in front of it
#elif defined(CAP) && defined(HOLES)
flat in float near;
uniform mat4 world_to_clip;
const float touching = 1e-4;  // of the receiver's view depth: a cap less far in front belongs to the receiver
#endif

void main() {
#if defined(WALL) && defined(COMPARE_POSITION)
    vec3 receiver = texelFetch(surface_position, ivec2(gl_FragCoord.xy), 0).xyz;
    if (wall_is_behind(receiver) != counted_behind) discard;
#elif defined(CAP) && defined(HOLES)
    vec4 receiver = vec4(texelFetch(surface_position, ivec2(gl_FragCoord.xy), 0).xyz, 1.0);
    if (near > 0.0 && 1.0 < (1.0 - touching) * gl_FragCoord.w * (world_to_clip * receiver).w) discard;  // seen through a hole
#endif
    count = gl_FrontFacing ? front_adds : -front_adds;
}
