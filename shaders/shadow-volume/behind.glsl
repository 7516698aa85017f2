// Depth test of a wall against the receiver, more precise than a depth buffer, whose resolution is mostly near the eye.
uniform vec3 eye;

const float parallel = 1e-5;  // sine of the angle between edge and light below which the wall's plane is all rounding
const float touching = 1e-3;  // of the receiver's distance: an edge less far in front belongs to the receiver

// Whether the camera ray's closest approach to a line is at the receiver or behind it.
bool line_is_behind(vec3 point, vec3 direction, vec3 receiver) {
    vec3 across = cross(receiver - eye, direction);
    return dot(point - receiver, cross(direction, across)) >= -touching * dot(across, across);
}

// Whether the camera ray intersects the wall of edge a → b at the receiver or behind it.
bool wall_is_behind(vec3 a, vec3 b, vec3 receiver) {
    vec3 along = b - a, away_a = light.w * a - light.xyz, away_b = light.w * b - light.xyz;
    vec3 normal = cross(along, away_a);
    // The wall of an edge along the light is a line.
    if (dot(normal, normal) <= parallel * parallel * dot(along, along) * dot(away_a, away_a))
        return line_is_behind(a, away_a, receiver);
    // Distances of eye and receiver from the wall's plane, scaled. With equal signs the intersection is behind the receiver.
    float of_eye = dot(normal, eye - a), of_receiver = dot(normal, receiver - a);
    float side = of_eye < 0.0 ? -1.0 : 1.0;
    // The rasteriser's subpixel grid covers some pixels whose ray just misses the wall. If the wall is edge-on, such a
    // ray intersects its plane anywhere. Then the wall's border decides, which the adjacent wall or cap shares, so that
    // their counts cancel.
    vec3 from_a = side * (of_eye * (receiver - a) - of_receiver * (eye - a));  // intersection relative to a, scaled
    vec3 from_b = side * (of_eye * (receiver - b) - of_receiver * (eye - b));
    if (dot(cross(away_a, normal), from_a) < 0.0) return line_is_behind(a, away_a, receiver);
    if (dot(cross(normal, away_b), from_b) < 0.0) return line_is_behind(b, away_b, receiver);
    // The edge last: seen end-on, its closest approach is ill-conditioned.
    if (dot(cross(normal, along), from_a) < 0.0) return line_is_behind(a, along, receiver);
    return side * of_receiver >= 0.0;
}
