// The wall of an edge, away from the light to a plane or to infinity: the triangles a, b, far a and far a, b, far b.
// Always wound so: with the opposite winding, rounding would rasterise the same wall differently, and walls that should
// cancel would leave single pixels.
in vec3 a;
in vec3 b;
#include "shadow-volume/project.glsl"
uniform vec4 far_plane;  // n·x + d = 0, passed by all walls on their way from the light; 0 for infinity
#ifdef COMPARE_POSITION
uniform vec4 eye;  // w = 0: towards it, of parallel rays; w = 1: its position
flat out vec3 edge_a;
flat out vec3 wall_normal;
flat out vec4 border_a;
flat out vec4 border_b;
flat out vec4 border_edge;
flat out vec4 inverse_a;
flat out vec4 inverse_b;
flat out vec4 inverse_edge;

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
vec3 toward_eye(vec3 point) { return eye.xyz - eye.w * point; }

// (n, w) of the plane n·x ≥ w through a point, where x is from the eye, or from the origin if rays are parallel.
vec4 border(vec3 normal, vec3 point) { return vec4(normal, (1.0 - eye.w) * dot(normal, point)); }

// (n, w) of the plane n·x + w = 1 through a line, perpendicular to the plane through the line and the eye.
vec4 inverse(vec3 point, vec3 direction) {
    vec3 from_eye = -toward_eye(point), normal = cross(direction, cross(from_eye, direction));
    normal /= max(dot(normal, from_eye), 1e-30);
    return vec4(normal, (1.0 - eye.w) * (1.0 - dot(normal, point)));
}
#endif

void main() {
    int corner = gl_VertexID % 6;
    bool is_far = corner == 2 || corner == 3 || corner == 5;
    vec3 near = corner == 0 || corner == 2 || corner == 3 ? a : b;
    gl_Position = clip_of(is_far ? far(near) : vec4(near, 1.0));
#ifdef COMPARE_POSITION
    vec3 along = b - a, normal = cross(along, away(a));
    float side = dot(normal, toward_eye(a)) < 0.0 ? -1.0 : 1.0;
    edge_a = a;
    // Away from the eye, and planes through the eye and the wall's borders, with the wall on their positive side.
    wall_normal = -side * normal;
    border_a = border(side * cross(away(a), toward_eye(a)), a);
    border_b = border(side * cross(toward_eye(b), away(b)), b);
    border_edge = border(side * cross(toward_eye(a), along), a);
    inverse_a = inverse(a, away(a));
    inverse_b = inverse(b, away(b));
    inverse_edge = inverse(a, along);
    // The wall of an edge along the light is a line: beyond border a everywhere.
    if (dot(normal, normal) <= parallel * parallel * dot(along, along) * dot(away(a), away(a))) border_a.w = 1e30;
#endif
}
