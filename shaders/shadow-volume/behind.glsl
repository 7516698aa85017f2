// Whether a camera's ray meets the wall of edge a → b at the receiver or behind it. A depth buffer says the same with
// fewer bits, most of which are spent on what is near.
uniform vec3 eye;

const float parallel = 1e-5;  // sine of an angle whose plane rounding turns about
const float touching = 1e-3;  // of the receiver's distance: an edge no further in front is the receiver's own

// Whether the receiver comes before the ray's closest approach to a line, or where the line touches it.
bool line_is_behind(vec3 point, vec3 direction, vec3 receiver) {
    vec3 across = cross(receiver - eye, direction);
    return dot(point - receiver, cross(direction, across)) >= -touching * dot(across, across);
}

bool wall_is_behind(vec3 a, vec3 b, vec3 receiver) {
    vec3 along = b - a, away_a = light.w * a - light.xyz, away_b = light.w * b - light.xyz;
    vec3 normal = cross(along, away_a);
    // An edge along the light has a wall without width.
    if (dot(normal, normal) <= parallel * parallel * dot(along, along) * dot(away_a, away_a))
        return line_is_behind(a, away_a, receiver);
    // Of the eye and the receiver to the wall's plane; both on one side: the ray has not met it yet.
    float of_eye = dot(normal, eye - a), of_receiver = dot(normal, receiver - a);
    float side = of_eye < 0.0 ? -1.0 : 1.0;
    // The rasteriser's grid lets in pixels whose ray passes the wall by a hair. Of a wall seen edge-on the plane is met
    // anywhere then, so that its border decides, which the next wall or cap has too: what both add cancels.
    vec3 from_a = side * (of_eye * (receiver - a) - of_receiver * (eye - a));  // where the plane is met, times a scale
    vec3 from_b = side * (of_eye * (receiver - b) - of_receiver * (eye - b));
    if (dot(cross(away_a, normal), from_a) < 0.0) return line_is_behind(a, away_a, receiver);
    if (dot(cross(normal, away_b), from_b) < 0.0) return line_is_behind(b, away_b, receiver);
    // The edge last: where it too is seen end-on, its closest approach is anywhere.
    if (dot(cross(normal, along), from_a) < 0.0) return line_is_behind(a, along, receiver);
    return side * of_receiver >= 0.0;
}
