// A cube map around the light, whose depth is the distance to the light divided by map_far. Offsets past a face's edge read
// the neighbouring face.
#include "cube_faces.glsl"
#define MAP_SAMPLER samplerCube
uniform MAP_SAMPLER map_depths;
#if GRADIENTS == 1
uniform usamplerCube map_gradients;
#endif
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

// The direction to the centre of the texel at an offset, 1 along the axis of the texel's own face.
vec3 toward_centre(ShadowCoord p, vec2 offset) {
    vec3 toward = lookup(p, offset);
    mat3 face = cube_faces[face_of(toward)];
    vec3 on_face = toward * face;
    vec2 texel = min(floor((0.5 + 0.5 * on_face.xy / on_face.z) * map_size), map_size - 1.0);  // on a seam, too
    return face * vec3((2.0 * texel + 1.0) / map_size - 1.0, 1.0);
}

Texel nearest_texel(ShadowCoord p, vec2 offset) {
#if GRADIENTS == 1
    vec3 toward = toward_centre(p, offset);  // on a seam the hardware may choose another face
    vec2 gradient = unpacked(textureLod(map_gradients, toward, 0.0).r);
#else
    vec3 toward = lookup(p, offset);
    vec2 gradient = vec2(0.0);
#endif
    return Texel(textureLod(map_depths, toward, 0.0).r, offset, gradient);
}

Texel[4] texels_around(ShadowCoord p, vec2 corner) {
    vec2 from = corner + 0.5 - p.uv * map_size;
    return Texel[4](nearest_texel(p, from), nearest_texel(p, from + vec2(1.0, 0.0)),
                    nearest_texel(p, from + vec2(0.0, 1.0)), nearest_texel(p, from + 1.0));
}

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

vec2 plane_gradient(ShadowCoord p) { return vec2(0.0); }  // no plane has a constant one

float receiver_change(ShadowCoord p, Texel t) {
    vec3 away = -p.axis * p.axis_distance, normal = p.receiver.normal;
    float along = dot(normal, normalize(toward_centre(p, t.offset))), height = dot(normal, away);
    return (along * height > 0.0 ? height / along / map_far : 1.0) - p.depth;
}

// On a plane the inverse of the distance along the face's axis is linear over the face.
float caster_change(ShadowCoord p, Texel t) {
    vec3 centre = toward_centre(p, t.offset);
    mat3 face = cube_faces[face_of(centre)];
    vec3 on_face = -p.axis * face;
    vec2 texels = (on_face.xy / on_face.z - (centre * face).xy) * map_size / 2.0;
    float inverse = max(1.0 + dot(t.gradient, texels), 1e-6);
    return t.depth - t.depth / length(centre) / (on_face.z * inverse);
}
