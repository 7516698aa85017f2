// The wall of an edge, away from the light to a plane or to infinity: the triangles a, b, far a and far a, b, far b.
// Always wound so: with the opposite winding, rounding would rasterise the same wall differently, and walls that should
// cancel would leave single pixels.
in vec3 a;
in vec3 b;
#include "shadow-volume/project.glsl"
uniform vec4 far_plane;  // n·x + d = 0, passed by all walls on their way from the light; 0 for infinity
#ifdef COMPARE_POSITION
uniform vec3 eye;
flat out vec3 edge_a;
flat out vec3 wall_normal;
flat out vec4 border_a;
flat out vec3 border_b;
flat out vec3 border_edge;
flat out vec3 inverse_a;
flat out vec3 inverse_b;
flat out vec3 inverse_edge;

const float parallel = 1e-5;  // sine of the angle between edge and light below which the wall's plane is all rounding
#endif

// Where a point's shadow ends. Bit-identical for the walls on either side.
vec4 far(vec3 point) {
    precise vec3 direction = away(point);
    precise float approach = -dot(far_plane.xyz, direction);
    if (approach <= 0.0) return vec4(direction, 0.0);
    precise float steps = max((dot(far_plane.xyz, point) + far_plane.w) / approach, 0.0);
    precise vec3 end = point + steps * direction;
    return vec4(end, 1.0);
}

#ifdef COMPARE_POSITION
// n of the plane n·(x − eye) = 1 through a line, perpendicular to the plane through the line and the eye.
vec3 inverse(vec3 point, vec3 direction) {
    vec3 normal = cross(direction, cross(point - eye, direction));
    return normal / max(dot(normal, point - eye), 1e-30);
}
#endif

void main() {
    int corner = gl_VertexID % 6;
    bool is_far = corner == 2 || corner == 3 || corner == 5;
    vec3 near = corner == 0 || corner == 2 || corner == 3 ? a : b;
    gl_Position = clip_of(is_far ? far(near) : vec4(near, 1.0));
#ifdef COMPARE_POSITION
    vec3 along = b - a, normal = cross(along, away(a));
    float side = dot(normal, eye - a) < 0.0 ? -1.0 : 1.0;
    edge_a = a;
    // Away from the eye, and planes through the eye and the wall's borders, with the wall on their positive side.
    wall_normal = -side * normal;
    border_a = vec4(side * cross(away(a), eye - a), 0.0);
    border_b = side * cross(eye - b, away(b));
    border_edge = side * cross(eye - a, along);
    inverse_a = inverse(a, away(a));
    inverse_b = inverse(b, away(b));
    inverse_edge = inverse(a, along);
    // The wall of an edge along the light is a line: beyond border a everywhere.
    if (dot(normal, normal) <= parallel * parallel * dot(along, along) * dot(away(a), away(a))) border_a.w = 1e30;
#endif
}
