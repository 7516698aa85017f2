// 1 where no texel around the receiver stores a depth nearer than its plane, 0 where all are clearly nearer; else ½.
#define FILTER_HAS_PLANE

float filter_visibility(ShadowCoord p) {
    float least = 1.0, most = -1.0, low = 1.0, high = -1.0;
    vec2 corner = floor(p.uv * map_size - 0.5) - float(FILTER_TEXELS - 1);
    for (int y = 0; y < 2 * FILTER_TEXELS; y += 2)
        for (int x = 0; x < 2 * FILTER_TEXELS; x += 2) {
            vec4 stored = stored_depths(p, corner + vec2(x, y)), plane = plane_depths(p, corner + vec2(x, y));
            vec4 behind = min(plane, 1.0) - stored;  // an empty texel, of depth 1, is beyond all receivers
            behind = mix(behind, vec4(p.depth), lessThanEqual(stored, vec4(0.0)));  // casters clamped to the near plane
            least = min(least, min(min(behind.x, behind.y), min(behind.z, behind.w)));
            most = max(most, max(max(behind.x, behind.y), max(behind.z, behind.w)));
            low = min(low, min(min(plane.x, plane.y), min(plane.z, plane.w)));
            high = max(high, max(max(plane.x, plane.y), max(plane.z, plane.w)));
        }
    // Corners are snapped to the rasteriser's grid, which moves stored depths by as much of their change across a texel.
    float width = max(p.texel.x, p.texel.y) * p.depth_per_length, slope = (high - low) / float(2 * FILTER_TEXELS - 1);
    if (most <= 8.0 * p.step + 2.0 * subpixel * slope) return 1.0;
    if (least > 0.5 * slope + 2.0 * width) return 0.0;
    return 0.5;
}
