// Shadow coordinates of a receiver in a cube map, whose depth is the distance to the light divided by map_far, and the
// depth comparisons. Needs MAP_CUBE. Offsets past a face's edge read the neighbouring face.
#include "map.glsl"
#include "bias.glsl"
#include "cube_faces.glsl"
#define MAP_SAMPLER samplerCube
uniform MAP_SAMPLER map_depths;
#ifdef FILTER_CONTENTS
uniform MAP_SAMPLER map_contents;
#endif
uniform samplerCubeShadow map_compare;  // the same map with hardware comparison, 2×2 linear, seamless at edges
uniform float map_far;                  // local length
uniform vec3 eye;
uniform float view_far;                 // the camera's far plane

float filter_reach(ShadowCoord p);  // radius of the filter, in texels

ShadowCoord shadow_coord(vec3 position) {
    vec3 away = position - light.xyz;
    vec3 lengths = abs(away);
    ShadowCoord p;
    p.position = position;
    if (lengths.x >= max(lengths.y, lengths.z)) p.layer = away.x > 0.0 ? 0 : 1;
    else if (lengths.y >= lengths.z) p.layer = away.y > 0.0 ? 2 : 3;
    else p.layer = away.z > 0.0 ? 4 : 5;
    vec3 on_face = away * cube_faces[p.layer];
    p.uv = 0.5 + 0.5 * on_face.xy / on_face.z;
    p.axis_distance = length(away);
    p.axis = -away / p.axis_distance;
    p.depth = p.axis_distance / map_far;
    p.depth_per_length = 1.0 / map_far;
    p.linear = p.depth;
    p.linear_per_length = p.depth_per_length;
    p.step = step_of_depth(p.depth_per_length);
    // Width of a texel in the plane parallel to the face through the receiver. Towards a corner the solid angle of a
    // texel shrinks, but the bound on its depth range does not: on the plane N·x = c the distance has over (s, t) the
    // gradient on_face.z · (u − N/(N·u)), projected onto the face, with u the unit direction. That vector is
    // perpendicular to u and of length tan θ, so that the distance changes by at most texel · tan θ over a texel, and
    // reaches that bound in one direction everywhere.
    p.texel = vec2(2.0 * on_face.z / map_size);
    p.radius = filter_reach(p);
    return p;
}

// Lookup direction for an offset in texels of the receiver's face.
vec3 offset_direction(ShadowCoord p, vec2 offset) {
    return cube_faces[p.layer] * vec3(offset * p.texel, 0.0) - p.axis * p.axis_distance;
}

// 1 unless the receiver's plane is behind the stored depth in that direction.
float compare_direction(ShadowCoord p, vec3 direction) {
    return p.depth - p.bias <= textureLod(map_depths, direction, 0.0).r ? 1.0 : 0.0;
}

#include "filter.glsl"
#ifndef FILTER_HAS_REACH
float filter_reach(ShadowCoord p) { return filter_radius; }
#endif

#ifdef FILTER_HAS_PLANE
// The plane N·x = N·P is met in the unit direction u at the distance N·P/(N·u).
float plane_depth(ShadowCoord p, vec2 offset) {
    vec3 away = -p.axis * p.axis_distance;
    float along = dot(p.normal, normalize(offset_direction(p, offset))), height = dot(p.normal, away);
    return along * height > 0.0 ? height / along / map_far - (p.depth - p.linear) : 1.0;
}
#define COMPARED(p, offset) plane_depth(p, offset)
#else
#define COMPARED(p, offset) (p.depth - p.bias)
#endif

float compare_nearest(ShadowCoord p, vec2 offset) {
    return COMPARED(p, offset) <= textureLod(map_depths, offset_direction(p, offset), 0.0).r ? 1.0 : 0.0;
}

float compare_linear(ShadowCoord p, vec2 offset) {
    return texture(map_compare, vec4(offset_direction(p, offset), COMPARED(p, offset)));
}

vec3 to_texels(ShadowCoord p, vec4 v) {
    vec3 on_face = (v.xyz - v.w * light.xyz) * cube_faces[p.layer];
    return vec3((on_face.xy + on_face.z) * map_size / 2.0, on_face.z);
}

#ifdef FILTER_CONTENTS
vec4 contents_of_level(ShadowCoord p, vec2 offset, float level) {
    return textureLod(map_contents, offset_direction(p, offset), level);
}
#endif

vec4 four_texels(MAP_SAMPLER map, ShadowCoord p, vec2 texel) {
    return textureGather(map, offset_direction(p, texel + 1.0 - p.uv * map_size));
}

// Visibility of a receiver.
float map_visibility(Receiver r) {
    ShadowCoord p = shadow_coord(r.position);
    p = shadow_coord(r.position + bias_offset(r, p));
    p.normal = r.normal;
    p.bias = bias_depth(r, p);
    p.linear = p.depth - p.bias;
    return r.facing ? filter_visibility(p) : 1.0;
}
