// The receiver's surroundings, for filters that are wide.

// Lengths across the light's ray, in homogeneous texels.
mat3 texels_across(ShadowCoord p) {
    vec3 to_light = normalize(light.xyz - light.w * p.position);
    vec3 right = normalize(cross(abs(to_light.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), to_light));
    mat3 texels = mat3(to_texels(p, vec4(right, 0.0)), to_texels(p, vec4(cross(to_light, right), 0.0)),
                       to_texels(p, vec4(p.position, 1.0)));
    return mat3(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -map_size * p.uv, 1.0) * texels;  // from the receiver's point
}

// The offset in texels by two such lengths.
vec2 offset_across(mat3 across, vec2 lengths) {
    vec3 texels = across * vec3(lengths, 1.0);
    return texels.xy / texels.z;
}
