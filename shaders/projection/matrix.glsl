// Projection of each layer by a matrix; LAYERS is the number of them.
#include "shadow_coord.glsl"
uniform mat4 world_to_map[LAYERS];
uniform mat4 map_to_world[LAYERS];     // its inverse
uniform vec4 world_to_linear[LAYERS];  // dot product with a position (w = 1) gives the linear depth
uniform vec2 texel_width[LAYERS];      // size of a texel in local lengths; for a spot at unit distance along its axis
uniform float depth_scale[LAYERS];     // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform vec3 light_axis;               // unit vector along the light's axis, pointing back to the light

const bool has_near_plane = true;

ShadowCoord divided(ShadowCoord p, vec4 clip) {
    p.uv = clip.xy / clip.w;
    p.depth = clip.z / clip.w;
    p.axis = light_axis;
    p.axis_distance = clip.w;
    p.depth_per_length = depth_scale[p.layer] / (clip.w * clip.w);
    p.linear = dot(world_to_linear[p.layer], vec4(p.position, 1.0));
    p.linear_per_length = length(world_to_linear[p.layer].xyz);
    p.texel = texel_width[p.layer] * clip.w;
    return p;
}
