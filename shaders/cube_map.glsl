// Where a receiver lies in a cube map whose depth is the distance to the light over map_far, and the two ways of comparing
// it. Directions past a face's edge fall on its neighbour.
#define MAP_CUBE
#include "map.glsl"
#include "cube_faces.glsl"
uniform samplerCube map_depths;
uniform samplerCubeShadow map_compare;  // the same map, compared and blended 2×2 by the hardware, across edges too
uniform float map_far;                  // local length

float filter_reach(ShadowCoord p);  // the filter's, in texels

ShadowCoord shadow_coord(vec3 position) {
    vec3 away = position - light.xyz;
    vec3 lengths = abs(away);
    ShadowCoord p;
    if (lengths.x >= max(lengths.y, lengths.z)) p.layer = away.x > 0.0 ? 0 : 1;
    else if (lengths.y >= lengths.z) p.layer = away.y > 0.0 ? 2 : 3;
    else p.layer = away.z > 0.0 ? 4 : 5;
    vec3 on_face = away * cube_faces[p.layer];
    p.uv = 0.5 + 0.5 * on_face.xy / on_face.z;
    p.axis_distance = length(away);
    p.axis = -away / p.axis_distance;
    p.depth = p.axis_distance / map_far;
    p.depth_per_length = 1.0 / map_far;
    p.step = step_of_depth(p.depth_per_length);
    // Across the face, as high as the receiver is along the face's axis. Towards a corner a texel is seen obliquely and
    // its solid angle shrinks, but no bound on depth may: over (s, t) on the plane N·x = c the distance has the gradient
    // on_face.z · (u − N/(N·u)) without its part along the face's axis, u the unit direction. That vector is tan θ
    // long and square to u, so a texel gains at most texel · tan θ anywhere, and as much along one direction everywhere.
    p.texel = vec2(2.0 * on_face.z / map_size);
    p.radius = filter_reach(p);
    return p;
}

// An offset in texels of the receiver's face, on the face's plane.
vec3 moved_direction(ShadowCoord p, vec2 offset) {
    return cube_faces[p.layer] * vec3(offset * p.texel, 0.0) - p.axis * p.axis_distance;
}

float compare_direction(ShadowCoord p, vec3 direction) {
    return p.depth - p.bias <= textureLod(map_depths, direction, 0.0).r ? 1.0 : 0.0;
}

float compare_nearest(ShadowCoord p, vec2 offset) { return compare_direction(p, moved_direction(p, offset)); }

float compare_linear(ShadowCoord p, vec2 offset) {
    return texture(map_compare, vec4(moved_direction(p, offset), p.depth - p.bias));
}
