// 1 or 0 where the map is certain, else ½. In a texel that no visible edge of the casters' silhouette crosses, what the light
// sees is one continuous surface: the receiver is on it, or below it throughout. Only where it meets the receiver, at a
// contact or a fold, is that not certain either; there some texel nearby stores a depth just before the receiver's plane.
#define FILTER_HAS_PLANE
#ifdef MAP_CUBE
uniform samplerCube map_edges;  // depth of the nearest edge that crosses the texel
#define NEAREST_EDGE(p, texel) textureLod(map_edges, offset_direction(p, (texel) + 0.5 - (p).uv * map_size), 0.0).r
#else
uniform sampler2D map_edges;
#define NEAREST_EDGE(p, texel) textureLod(map_edges, ((texel) + 0.5) / map_size, 0.0).r
#endif

float filter_visibility(ShadowCoord p) {
    vec2 texel = floor(p.uv * map_size), corner = floor(p.uv * map_size - 0.5);
    if (NEAREST_EDGE(p, texel) < p.depth - 8.0 * p.step) return 0.5;
    vec4 stored = stored_depths(p, corner), plane = plane_depths(p, corner);
    vec4 behind = min(plane, 1.0) - stored;  // an empty texel, of depth 1, is beyond all receivers
    behind = mix(behind, vec4(p.depth), lessThanEqual(stored, vec4(0.0)));  // casters clamped to the near plane
    // Corners are snapped to the rasteriser's grid, which moves stored depths by as much of their change across a texel;
    // a curved surface is before the receiver's plane by as little.
    float slope = abs(plane.z - plane.w) + abs(plane.x - plane.w), width = max(p.texel.x, p.texel.y) * p.depth_per_length;
    vec4 lit = vec4(lessThanEqual(behind, vec4(8.0 * p.step + 2.0 * subpixel * slope)));
    vec4 dark = vec4(greaterThan(behind, vec4(slope + 4.0 * width)));
    if (lit + dark != vec4(1.0)) return 0.5;
    vec2 side = texel - corner;
    return mix(mix(lit.w, lit.z, side.x), mix(lit.x, lit.y, side.x), side.y);
}
