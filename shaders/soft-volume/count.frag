// By how much the number of caster layers between a receiver and each point of the light differs from that of the centre, as
// far as one edge is the cause: seen from the receiver, the line from the centre to the point crosses the edge.
#include "receiver.glsl"
flat in vec3 corner_c, corner_a, corner_b, corner_d;
flat in float triangles;
uniform vec3 points[POINTS];  // positions, or unit vectors towards points of a sun
uniform float radius;
uniform bool count_both_facings;
out vec4 counts;  // four of the differences in each component, as digits from −32 to 31 of a number of base 64

// 1 if the corners, relative to the receiver, are counter-clockwise seen from beyond them, else −1.
float facing(vec3 a, vec3 b, vec3 c) { return dot(a, cross(b, c)) > 0.0 ? 1.0 : -1.0; }

void main() {
    Receiver r = receiver_here();
    if (!r.facing) discard;
    vec3 a = corner_a - r.position, b = corner_b - r.position, center = light.xyz - light.w * r.position;
    vec3 plane = cross(a, b);  // of receiver and edge
    float side = dot(plane, center);
    if (abs(side) > length(plane) * radius) discard;
    // Which of the edge's triangles face the light at a crossing depends on the receiver only.
    float weight = facing(a, b, corner_c - r.position);
    if (triangles > 1.0) weight += facing(a, b, corner_d - r.position);
    if (!count_both_facings) weight *= 0.5;
    if (weight == 0.0) discard;
    float squared = dot(center, center);
    float change[POINTS];
    for (int k = 0; k < POINTS; ++k) {
        vec3 to = points[k] - light.w * r.position, across = cross(center, to);
        float point_side = dot(plane, to), of_a = dot(across, a), of_b = dot(across, b);
        bool crossed = (point_side > 0.0) != (side > 0.0) && (of_a > 0.0) != (of_b > 0.0);
        float at = crossed ? dot(mix(a, b, of_a / (of_a - of_b)), center) : 0.0;  // towards the light, and before it
        crossed = crossed && at > 0.0 && (light.w == 0.0 || at < squared);
        change[k] = crossed ? point_side > 0.0 ? weight : -weight : 0.0;
    }
    for (int i = 0; i < 4; ++i)
        counts[i] = change[4 * i] + 64.0 * (change[4 * i + 1] + 64.0 * (change[4 * i + 2] + 64.0 * change[4 * i + 3]));
}
