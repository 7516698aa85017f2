// Depth test of a wall against the receiver, more precise than a depth buffer, whose resolution is mostly near the eye.
uniform vec3 eye;
flat in vec3 edge_a;
flat in vec3 wall_normal;  // away from the eye
flat in vec4 border_a;     // planes through the eye and the wall's borders: n·(x − eye) ≥ w on the wall's side
flat in vec3 border_b;
flat in vec3 border_edge;
flat in vec3 inverse_a;    // planes n·(x − eye) = 1 through the borders, perpendicular to the former
flat in vec3 inverse_b;
flat in vec3 inverse_edge;

const float touching = 1e-3;  // of the receiver's distance: an edge less far in front belongs to the receiver

// Whether the camera ray intersects the wall of edge a → b at the receiver or behind it.
bool wall_is_behind(vec3 receiver) {
    vec3 ray = receiver - eye;
    bool beyond_a = dot(border_a.xyz, ray) < border_a.w, beyond_b = dot(border_b, ray) < 0.0;
    bool missed = beyond_a || beyond_b || dot(border_edge, ray) < 0.0;
    // The rasteriser's subpixel grid covers some pixels whose ray just misses the wall. If the wall is edge-on, such a
    // ray intersects its plane anywhere. Then the ray's closest approach to the wall's border decides, which the
    // adjacent wall or cap shares, so that their counts cancel. The edge last: seen end-on, it is ill-conditioned.
    vec3 inverse = beyond_a ? inverse_a : beyond_b ? inverse_b : inverse_edge;
    float reach = beyond_a || beyond_b ? 1.0 : 1.0 - touching;
    return missed ? reach * dot(inverse, ray) <= 1.0 : dot(wall_normal, receiver - edge_a) <= 0.0;
}
