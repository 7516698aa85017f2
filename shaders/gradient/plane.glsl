// Gradient of depth over uv on the receiver's plane: constant over the map, for a spot too. Planes transform by the inverse
// transpose.
vec2 plane_gradient(ShadowCoord p) {
    vec4 plane = vec4(p.receiver.normal, -dot(p.receiver.normal, p.receiver.position)) * map_to_world[p.layer];
    return plane.z == 0.0 ? vec2(0.0) : -plane.xy / plane.z;
}
