// 1 or 0 where the map is certain, else ½. In texels that no visible edge of the casters' silhouette crosses, what the light
// sees is one continuous surface: the receiver is on it, or below it throughout, unless it meets the receiver there, at a
// contact or a fold. So neither an edge nor a surface close to the receiver's plane may be in the four texels around.
#include "plane.glsl"
#include "units.glsl"
uniform float cos_half_angle;  // of a spot's cone; −1 for other lights
uniform MAP_SAMPLER silhouette;  // depth of the nearest edge in the texel

// The first component of a texel and those right of and above it, in textureGather's order.
vec4 four_texels(MAP_SAMPLER map, ShadowCoord p, vec2 texel) {
    return textureGather(map, lookup(p, texel + 1.0 - p.uv * map_size));
}

// Depths are linear: those of a spot's map are too coarse far from it. Casters in front of the near plane have negative ones.
vec4 filter_contents(float depth) { return vec4(depth, 0.0, 0.0, 0.0); }

float filter_visibility(ShadowCoord p) {
    vec2 at = p.uv * map_size, corner = floor(at - 0.5);
    if (clamp(p.uv, 0.0, 1.0) != p.uv)  // outside the map, but perhaps in the cone
        return dot(normalize(light.xyz - light.w * p.position), p.axis) < cos_half_angle ? 1.0 : 0.5;
    if (p.linear <= 0.0) return 0.5;  // in front of the near plane, where edges are stored at it
    float tolerance = 8.0 * max(depth_step, position_step * p.linear_per_length);
    if (any(lessThan(four_texels(silhouette, p, corner), vec4(p.linear - tolerance)))) return 0.5;
    vec2 from = corner + 0.5 - at;
    vec4 plane = vec4(plane_depth(p, from + vec2(0.0, 1.0)), plane_depth(p, from + 1.0),
                      plane_depth(p, from + vec2(1.0, 0.0)), plane_depth(p, from));
    vec4 behind = min(plane, 1.0) - four_texels(map_contents, p, corner);  // an empty texel, of depth 1, is beyond all receivers
    // Corners are snapped to the rasteriser's grid, which moves stored depths by as much of their change across a texel;
    // a curved surface is before the receiver's plane by as little.
    float slope = max(max(plane.x, plane.y), max(plane.z, plane.w)) - min(min(plane.x, plane.y), min(plane.z, plane.w));
    float width = max(p.texel.x, p.texel.y) * p.linear_per_length;
    if (all(lessThanEqual(behind, vec4(tolerance + min((2.0 * subpixel + 0.05) * slope, width))))) return 1.0;
    return all(greaterThan(behind, vec4(slope + 4.0 * width))) ? 0.0 : 0.5;
}
