// A march from the receiver towards the light through what the view shows: see `ScreenSpace`.
uniform sampler2D surface_depth;    // of the nearest pixel
uniform sampler2D surface_between;  // the same, bilinear
uniform mat4 world_to_clip;
uniform vec4 world_to_depth;  // to the distance along the view
uniform vec4 eye;  // or with w = 0 the direction of parallel views
uniform float view_far;
uniform float contact_length, contact_reach, contact_stride, contact_thickness, contact_share, contact_first, contact_jitter, contact_bend, contact_soft, contact_border;

// Towards the light, turned towards the normal where the light grazes.
vec3 ray_direction(Receiver r) {
    if (contact_bend == 0.0) return r.to_light;
    float angle = radians(contact_bend) * (1.0 - smoothstep(0.25, 0.45, r.cosine));
    return cos(angle) * r.to_light + sin(angle) * normalize(r.normal - r.cosine * r.to_light);
}

// How far a point is behind the surface that the view shows at its place, along the view; not positive in front.
float behind_surface(vec3 point, float depth, vec2 at) {
#ifdef CONTACT_DEPTH_PLANE
    vec4 seen = textureLod(surface_position, at, 0.0);
    if (seen.w == 0.0) return 0.0;
    vec3 normal = textureLod(surface_normal, at, 0.0).xyz;
    vec3 view = point * eye.w - eye.xyz;
    float other = dot(normal, point - seen.xyz) / dot(normal, view) * dot(world_to_depth.xyz, view);
    float nearest = depth - dot(world_to_depth, vec4(seen.xyz, 1.0));
#else
    float nearest = depth - view_far * textureLod(surface_depth, at, 0.0).r, other = nearest;
#ifdef CONTACT_DEPTH_BOTH
    other = depth - view_far * textureLod(surface_between, at, 0.0).r;
#endif
#endif
    return min(nearest, other);
}

float contact_shadow(Receiver r) {
    // The line on the screen, by a point that is far enough along the ray to be exact and not behind the eye.
    float unit = 0.1 * dot(world_to_depth, vec4(r.position, 1.0));
    vec3 ray = unit * ray_direction(r);
    vec4 from = world_to_clip * vec4(r.position, 1.0), to = world_to_clip * vec4(r.position + ray, 1.0);
    vec2 start = 0.5 * from.xy / from.w + 0.5;
    vec2 line = 0.5 * to.xy / to.w + 0.5 - start;
    vec2 pixels = abs(line) * vec2(textureSize(surface_position, 0));
    float shown = max(max(pixels.x, pixels.y), 1e-3);
    // The ray's length on the screen, in parts of the line, and not beyond the view.
    float t = contact_length / unit, w = mix(from.w, to.w, t);
    vec2 room = (step(0.0, line) - start) / line;
    float end = min(max(w > 0.0 ? t * to.w / w : room.x, contact_reach / shown), min(room.x, room.y));
    float points = float(CONTACT_STEPS);
    if (contact_stride > 0.0) points = min(points, ceil(end * shown / contact_stride));
    float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
    for (float i = contact_first + contact_jitter * noise; i <= points; i += 1.0) {
        float s = end * i / points;
        w = mix(to.w, from.w, s);
        if (w <= 0.0) return 0.0;  // beyond the vanishing point
        vec2 at = start + s * line;
        vec3 along = ray * s * from.w / w;
        if (light.w == 1.0 && length(along) > r.distance) return 0.0;
        float depth = dot(world_to_depth, vec4(r.position + along, 1.0));
        float behind = behind_surface(r.position + along, depth, at);
        float thickness = contact_thickness + contact_share * depth;
        if (behind > 0.0 && behind < thickness) {
            vec2 edge = max((abs(at - 0.5) - 0.5) / max(contact_border, 1e-6) + 1.0, 0.0);
            return min((1.0 - behind / thickness) / max(contact_soft, 1e-6), 1.0) * max(1.0 - dot(edge, edge), 0.0);
        }
    }
    return 0.0;
}
