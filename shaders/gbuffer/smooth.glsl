// The smooth surface that a triangle stands for.
#ifdef SMOOTH
uniform sampler2D corners;  // six texels for a triangle: position and normal of each corner
layout(location = 3) out vec4 surface_smooth_position;
layout(location = 4) out vec4 surface_shading_normal;

// The normal is that of Phong shading, on the side of the geometric one. The point is P' = Σ wᵢ (P − min(0, (P − Vᵢ)·Nᵢ) Nᵢ)
// with barycentric weights w: above the tangent planes at the corners (Hanika 2021, "Hacking the shadow terminator").
void write_smooth_surface(int triangle, vec3 point, vec4 normal) {
    ivec2 first = texel_of(triangle) * ivec2(6, 1);
    vec3 at[3], normals[3];
    for (int k = 0; k < 3; ++k) {
        at[k] = point - texelFetch(corners, first + ivec2(2 * k, 0), 0).xyz;
        normals[k] = texelFetch(corners, first + ivec2(2 * k + 1, 0), 0).xyz;
    }
    vec3 weights = vec3(dot(cross(at[1], at[2]), normal.xyz), dot(cross(at[2], at[0]), normal.xyz), dot(cross(at[0], at[1]), normal.xyz));
    weights /= weights.x + weights.y + weights.z;
    vec3 mean = weights.x * normals[0] + weights.y * normals[1] + weights.z * normals[2];
    float side = dot(mean, normal.xyz) < 0.0 ? -1.0 : 1.0;
    vec3 lift = vec3(0.0);
    for (int k = 0; k < 3; ++k) lift -= weights[k] * min(side * dot(at[k], normals[k]), 0.0) * side * normals[k];
    surface_smooth_position = vec4(point + lift, 1.0);
    surface_shading_normal = vec4(side * normalize(mean), normal.w);
}
#else
void write_smooth_surface(int triangle, vec3 point, vec4 normal) {}
#endif
