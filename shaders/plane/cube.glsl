vec3 to_texels(ShadowCoord p, vec4 v) {
    vec3 on_face = (v.xyz - v.w * light.xyz) * cube_faces[p.layer];
    return vec3((on_face.xy + on_face.z) * map_size / 2.0, on_face.z);
}

// The plane N·x = N·P is met in the unit direction u at the distance N·P/(N·u).
float plane_depth(ShadowCoord p, vec2 offset) {
    vec3 away = -p.axis * p.axis_distance, normal = p.receiver.normal;
    float along = dot(normal, normalize(lookup(p, offset))), height = dot(normal, away);
    return along * height > 0.0 ? height / along / map_far - (p.depth - p.linear) : 1.0;
}
