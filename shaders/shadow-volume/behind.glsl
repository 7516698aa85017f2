// Depth test of a wall against the receiver, more precise than a depth buffer, whose resolution is mostly near the eye.
uniform vec4 eye;
flat in vec3 edge_a;
flat in vec3 wall_normal;  // away from the eye
flat in vec4 border_a;     // planes through the eye and the wall's borders: n·ray ≥ w on the wall's side
flat in vec4 border_b;
flat in vec4 border_edge;
flat in vec4 inverse_a;    // planes n·ray + w = 1 through the borders, perpendicular to the former
flat in vec4 inverse_b;
flat in vec4 inverse_edge;

const float touching = 1e-3;  // of the receiver's distance, or the view's height: an edge less far in front belongs to the receiver

// Whether the camera ray intersects the wall of edge a → b at the receiver or behind it.
bool wall_is_behind(vec3 receiver) {
    vec3 ray = receiver - eye.w * eye.xyz;
    bool beyond_a = dot(border_a.xyz, ray) < border_a.w, beyond_b = dot(border_b.xyz, ray) < border_b.w;
    bool missed = beyond_a || beyond_b || dot(border_edge.xyz, ray) < border_edge.w;
    // The rasteriser's subpixel grid covers some pixels whose ray just misses the wall. If the wall is edge-on, such a
    // ray intersects its plane anywhere. Then the ray's closest approach to the wall's border decides, which the
    // adjacent wall or cap shares, so that their counts cancel. The edge last: seen end-on, it is ill-conditioned.
    vec4 inverse = beyond_a ? inverse_a : beyond_b ? inverse_b : inverse_edge;
    float reach = beyond_a || beyond_b ? 1.0 : 1.0 - touching;
    return missed ? reach * (dot(inverse.xyz, ray) + inverse.w) <= 1.0 : dot(wall_normal, receiver - edge_a) <= 0.0;
}
