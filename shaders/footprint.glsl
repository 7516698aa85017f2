// The offset in texels on the receiver's plane from one pixel to the next: derivatives of the G-buffer are wrong at
// silhouettes, where they span two surfaces.
#ifndef MAP_CUBE
uniform vec3 eye;
#endif
uniform vec3 forward;
uniform vec3 pixel_right;  // from one pixel's ray to the next, at unit depth
uniform vec3 pixel_up;

vec2 footprint(ShadowCoord p, vec3 pixel) {
    vec3 away = p.position - eye;
    vec3 ray = away / dot(away, forward) + pixel;
    float along = dot(p.normal, ray), height = dot(p.normal, away);
    // A plane seen edge-on: at most to twice the distance.
    float reach = along * height > 0.0 ? min(height / along, 2.0 * dot(away, forward)) : 2.0 * dot(away, forward);
    vec3 texels = to_texels(p, vec4(eye + ray * reach, 1.0));
    return texels.xy / texels.z - p.uv * map_size;
}
