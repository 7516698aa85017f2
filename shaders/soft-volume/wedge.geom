// The penumbra wedge of an edge: a convex hull of all points to which the edge hides part of the light. Only for edges that
// are a silhouette from some point of the light.
layout(lines_adjacency) in;
layout(triangle_strip, max_vertices = 24) out;
in vec3 world[];
flat in int id[];
uniform mat4 world_to_clip;
uniform vec4 light;
uniform float radius;  // tangent of a sun's angular radius, or a length that holds other lights
uniform float reach;   // a length beyond all receivers
flat out vec3 corner_c, corner_a, corner_b, corner_d;
flat out float triangles;  // of the edge

vec3 hull[6];

void triangle(int i, int j, int k) {
    int corners[3] = int[](i, j, k);
    for (int n = 0; n < 3; ++n) {
        gl_Position = world_to_clip * vec4(hull[corners[n]], 1.0);
        corner_c = world[0];
        corner_a = world[1];
        corner_b = world[2];
        corner_d = world[3];
        triangles = id[3] == id[1] ? 1.0 : 2.0;
        EmitVertex();
    }
    EndPrimitive();
}

// 1 if a, b, c are counter-clockwise seen from all of the light, −1 if clockwise, else 0, as for an edge's missing triangle.
float facing(vec3 a, vec3 b, vec3 c) {
    vec3 normal = cross(b - a, c - a);
    float height = dot(normal, light.xyz - light.w * a), most = length(normal) * radius;
    return height > most ? 1.0 : height < -most ? -1.0 : 0.0;
}

void main() {
    vec3 a = world[1], b = world[2];
    float one = facing(a, b, world[0]), other = facing(a, b, world[3]);
    if (one != 0.0 && one == -other) return;

    vec3 along = normalize(b - a), away_a = light.w * a - light.xyz, away_b = light.w * b - light.xyz;
    float least = light.w == 0.0 ? 1.0 : length(away_a + clamp(dot(-away_a, along), 0.0, length(b - a)) * along);
    float far = reach / least;
    // The light's apparent radius; of a sphere, that of its tangent cone.
    float r = 1.02 * (light.w == 0.0 ? radius : radius * inversesqrt(max(1.0 - pow(radius / least, 2.0), 0.01)));
    vec2 size = vec2(length(away_a), length(away_b));
    vec2 cosine = vec2(dot(away_a, along), dot(away_b, along)) / size;
    vec2 sine = sqrt(max(1.0 - cosine * cosine, 0.0));
    // How much wider than across its axis the cone of an edge's end is in the plane of the edge.
    vec2 oblique = r / size * abs(cosine) / max(sine, 1e-6);
    float most = max(oblique.x, oblique.y), least_sine = min(sine.x, sine.y);
    if (least_sine > 0.25 && most < 0.5) {
        vec3 across = r / (1.0 - most) * normalize(cross(along, away_a));
        vec2 ahead = r / (sine * (1.0 - most));
        hull = vec3[](a, b, a + far * (away_a + across - ahead.x * along), b + far * (away_b + across + ahead.y * along),
                      a + far * (away_a - across - ahead.x * along), b + far * (away_b - across + ahead.y * along));
    } else {
        // Seen nearly end-on: a pyramid from the end that is nearer to the light.
        bool from_a = dot(away_a + away_b, along) > 0.0;
        vec3 apex = from_a ? a : b, axis = from_a ? away_a : away_b;
        float slope = r + length(axis) * max(sine.x, sine.y) / max(max(abs(cosine.x), abs(cosine.y)), 0.1);
        vec3 u = slope * normalize(cross(abs(axis.x) < 0.5 * length(axis) ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0), axis));
        vec3 v = slope * normalize(cross(axis, u));
        hull = vec3[](apex, apex, apex + far * (axis + u - v), apex + far * (axis + u + v), apex + far * (axis - u - v),
                      apex + far * (axis - u + v));
    }
    triangle(0, 1, 3);
    triangle(0, 3, 2);
    triangle(1, 0, 4);
    triangle(1, 4, 5);
    triangle(0, 2, 4);
    triangle(1, 5, 3);
    triangle(2, 3, 5);
    triangle(2, 5, 4);
}
