// The two ways of comparing a receiver with a cube map. Directions past a face's edge fall on its neighbour.
uniform samplerCube map_depths;
uniform samplerCubeShadow map_compare;  // the same map, compared and blended 2×2 by the hardware, across edges too

// An offset in texels of the receiver's face, on the face's plane.
vec3 moved_direction(MapPoint p, vec2 offset) {
    return cube_faces[p.layer] * vec3(offset * p.texel, 0.0) - p.axis * p.axis_distance;
}

float compare_direction(MapPoint p, vec3 direction) {
    return p.depth - p.bias <= textureLod(map_depths, direction, 0.0).r ? 1.0 : 0.0;
}

float compare_nearest(MapPoint p, vec2 offset) { return compare_direction(p, moved_direction(p, offset)); }

float compare_linear(MapPoint p, vec2 offset) {
    return texture(map_compare, vec4(moved_direction(p, offset), p.depth - p.bias));
}
