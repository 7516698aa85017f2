// A cube map around the light, whose depth is the distance to the light divided by map_far. Offsets past a face's edge read
// the neighbouring face.
#include "cube_faces.glsl"
#define MAP_SAMPLER samplerCube
uniform MAP_SAMPLER map_depths;
uniform samplerCubeShadow map_compare;  // the same map with hardware comparison, 2×2 linear, seamless at edges
uniform float map_far;  // local length
const bool has_near_plane = false;  // no caster is in front of the light

int face_of(vec3 away) {
    vec3 lengths = abs(away);
    if (lengths.x >= max(lengths.y, lengths.z)) return away.x > 0.0 ? 0 : 1;
    if (lengths.y >= lengths.z) return away.y > 0.0 ? 2 : 3;
    return away.z > 0.0 ? 4 : 5;
}

ShadowCoord projected(ShadowCoord p) {
    vec3 away = p.position - light.xyz;
    p.layer = face_of(away);
    vec3 on_face = away * cube_faces[p.layer];
    p.uv = 0.5 + 0.5 * on_face.xy / on_face.z;
    p.axis_distance = length(away);
    p.axis = -away / p.axis_distance;
    p.depth = p.axis_distance / map_far;
    p.depth_per_length = 1.0 / map_far;
    p.linear = p.depth;
    p.linear_per_length = p.depth_per_length;
    // Width of a texel in the plane parallel to the face through the receiver. Towards a corner the solid angle of a
    // texel shrinks, but the bound on its depth range does not: on the plane N·x = c the distance has over (s, t) the
    // gradient on_face.z · (u − N/(N·u)), projected onto the face, with u the unit direction. That vector is
    // perpendicular to u and of length tan θ, so that the distance changes by at most texel · tan θ over a texel, and
    // reaches that bound in one direction everywhere.
    p.texel = vec2(2.0 * on_face.z / map_size);
    return p;
}

vec3 lookup(ShadowCoord p, vec2 offset) {
    return cube_faces[p.layer] * vec3(offset * p.texel, 0.0) - p.axis * p.axis_distance;
}

float nearest_depth(ShadowCoord p, vec2 offset) { return textureLod(map_depths, lookup(p, offset), 0.0).r; }

float hardware_comparison(ShadowCoord p, vec2 offset, float depth) {
    return texture(map_compare, vec4(lookup(p, offset), depth));
}

vec3 to_texels(ShadowCoord p, vec4 v) {
    vec3 on_face = (v.xyz - v.w * light.xyz) * cube_faces[p.layer];
    return vec3((on_face.xy + on_face.z) * map_size / 2.0, on_face.z);
}

// The plane N·x = N·P is met in the unit direction u at the distance N·P/(N·u).
float plane_depth(ShadowCoord p, vec2 offset) {
    vec3 away = -p.axis * p.axis_distance, normal = p.receiver.normal;
    float along = dot(normal, normalize(lookup(p, offset))), height = dot(normal, away);
    return along * height > 0.0 ? height / along / map_far - (p.depth - p.linear) : 1.0;
}

#if ON_PLANE == 1
float compare_nearest(ShadowCoord p, vec2 offset) {
    return plane_depth(p, offset) <= nearest_depth(p, offset) ? 1.0 : 0.0;
}

float compare_linear(ShadowCoord p, vec2 offset) { return hardware_comparison(p, offset, plane_depth(p, offset)); }
#endif
