// Shadow mapping (Williams 1978) with percentage-closer filtering (Reeves, Salesin and Cook 1987): visibility is
// lit(bias(receiver)), of the receiver's point in the map. Names in <> are chosen where the shader is composed.
#include "map.glsl"

// Sine of the angle between the surface's normal and the direction of the map's depth. For a directional light and for a
// cube map, whose depth is the distance, that angle is θ, between N and L. For a spot it differs from θ off the axis,
// where the map's depth varies even over a surface that faces the light.
float sin_slope(ShadowCoord p) {
    float along = dot(p.receiver.normal, p.axis);
    return sqrt(max(1.0 - along * along, 0.0));
}

// Change of the distance along the axis per length across the map: on the plane N·P = c the distance in direction
// d (d·axis = 1) is c/(N·d), and its gradient is |N perpendicular to the axis| · distance/(N·d).
float tan_slope(ShadowCoord p) {
    return sin_slope(p) * p.axis_distance / (p.receiver.distance * max(p.receiver.cosine, 1e-6));
}

// Resolution of the comparison: the larger of the format's step and the rounding error of positions, which dominates over
// a short depth range.
float resolution(ShadowCoord p) { return max(depth_step, position_step * p.depth_per_length); }

// A filter: a file that defines
//   float filter_visibility(ShadowCoord p)    visibility of a receiver
//   vec4 filter_contents(float depth)         if it has `contents` in Python: what the map stores for a caster at a linear
//                                             depth, which is negative for casters in front of the near plane
// by the functions of map.glsl and these, with offsets in texels from the receiver's own point:
//   float compare_nearest(ShadowCoord p, vec2 offset)    of the nearest texel: 1 lit, 0 in shadow
//   float compare_linear(ShadowCoord p, vec2 offset)     of the four nearest, with bilinear weights
//   vec4 contents_at(ShadowCoord p, vec2 offset)         what the filter stored there, blurred and from the mip levels
// Filters as wide as the scene asks for may include plane.glsl.

// A comparison, which a bias or the filter may bring: a file that defines
//   bool texel_lit(ShadowCoord p, Texel t)    whether the stored caster does not shadow the receiver
//   HARDWARE_DEPTH(p, offset)                 if it defines it, the depth with which all texels around are compared
//   float texel_sure(ShadowCoord p, Texel t)  if it defines TEXEL_SURE, the same by the depth alone: 1, 0, or unsure
const float unsure = 9.0;  // more than any four texels together
#include <comparison>

#ifdef HARDWARE_DEPTH
float compare_nearest(ShadowCoord p, vec2 offset) { return texel_lit(p, nearest_texel(p, offset)) ? 1.0 : 0.0; }

float compare_linear(ShadowCoord p, vec2 offset) {
    return hardware_comparison(p, offset, HARDWARE_DEPTH(p, offset));
}
#else
float compare_nearest(ShadowCoord p, vec2 offset) {
    return texel_lit(p, nearest_texel(p, to_centre(p, offset))) ? 1.0 : 0.0;
}

// Whether the four texels from a corner on are lit, right first: 1 or 0, sure ones perhaps unsure.
vec4 lit_around(ShadowCoord p, vec2 corner) {
    Texel t[4] = texels_around(p, corner);
    return vec4(texel_lit(p, t[0]), texel_lit(p, t[1]), texel_lit(p, t[2]), texel_lit(p, t[3]));
}

#ifndef TEXEL_SURE
#define texel_sure(p, t) float(texel_lit(p, t))
#endif
vec4 sure_around(ShadowCoord p, vec2 corner) {
    Texel t[4] = texels_around(p, corner);
    return vec4(texel_sure(p, t[0]), texel_sure(p, t[1]), texel_sure(p, t[2]), texel_sure(p, t[3]));
}

float compare_linear(ShadowCoord p, vec2 offset) {
    vec2 at = p.uv * map_size + offset - 0.5, corner = floor(at), weight = at - corner;
    vec4 lit = lit_around(p, corner);
    return mix(mix(lit.x, lit.y, weight.x), mix(lit.z, lit.w, weight.x), weight.y);
}
#endif

// Whether the caster of this linear depth, stored at an offset, is in front of the receiver.
#ifdef BLOCKS
bool blocks(ShadowCoord p, vec2 offset, float linear) { return BLOCKS(p, offset, linear); }
#else
bool blocks(ShadowCoord p, vec2 offset, float linear) { return compare_nearest(p, offset) == 0.0; }
#endif
uniform MAP_SAMPLER map_contents;  // what the filter stored, blurred

vec4 contents_of_level(ShadowCoord p, vec2 offset, float level) { return textureLod(map_contents, lookup(p, offset), level); }
#if MIPMAPPED == 0
vec4 contents_at(ShadowCoord p, vec2 offset) { return contents_of_level(p, offset, 0.0); }
#else
uniform vec4 eye;  // of the camera
uniform vec3 forward;
uniform vec3 pixel_right;  // from one pixel's ray to the next, at unit depth; of parallel rays everywhere
uniform vec3 pixel_up;

// The offset in texels on the receiver's plane from one pixel to the next: derivatives of the G-buffer are wrong at
// silhouettes, where they span two surfaces.
vec2 footprint(ShadowCoord p, vec3 pixel) {
    vec3 from = eye.xyz + (1.0 - eye.w) * p.position, beside = (1.0 - eye.w) * pixel;
    vec3 away = p.position - from;
    vec3 ray = away / dot(away, forward) + eye.w * pixel;
    float along = dot(p.receiver.normal, ray), height = dot(p.receiver.normal, away - beside);
    // A plane seen edge-on: at most to twice the distance, which is the view's height where rays are parallel.
    float reach = along * height > 0.0 ? min(height / along, 2.0 * dot(away, forward)) : 2.0 * dot(away, forward);
    vec3 texels = to_texels(p, vec4(from + beside + ray * reach, 1.0));
    return texels.xy / texels.z - p.uv * map_size;
}

// The mean over the pixel's footprint, by up to 8 samples along its longer side. Levels are mixed here since llvmpipe
// returns wrong values in quads of which only some pixels need a level above 0.
vec4 contents_at(ShadowCoord p, vec2 offset) {
    vec2 right = footprint(p, pixel_right), up = footprint(p, pixel_up);
    vec2 longer = dot(right, right) > dot(up, up) ? right : up;
    float side = max(length(longer), 1e-6), other = min(length(right), length(up));
    float samples = clamp(ceil(side / max(other, 1.0)), 1.0, 8.0);
    float level = max(log2(max(side / samples, other)), 0.0);
    vec4 sum = vec4(0.0);
    for (float i = 0.5; i < samples; ++i) {
        vec2 at = offset + longer * (i / samples - 0.5);
        sum += mix(contents_of_level(p, at, floor(level)), contents_of_level(p, at, ceil(level)), fract(level));
    }
    return sum / samples;
}
#endif
#include <filter>

// A bias: a file that defines
//   ShadowCoord bias(ShadowCoord p)    the receiver's point with a larger `bias`, another `gradient`, or `moved`
// by the functions above and
//   float radius(ShadowCoord p)        largest distance of a compared texel's points from the receiver's point, in texels
#ifndef FILTER_HAS_RADIUS
uniform float filter_radius;

float radius(ShadowCoord p) { return filter_radius; }
#endif
#include <bias>

// Receivers beyond the map's far plane are lit, or in shadow as where nothing is done about them: explicitly, as fixed-point
// formats clamp the compared depth and float formats do not.
const float visibility_beyond = float(LIT_BEYOND);

bool beyond(ShadowCoord p) {
    return LIT_BEYOND == 1 ? from_near(p.depth) > 1.0 : from_near(p.depth) - 1.0 - p.bias > 0.0;
}

// Visibility of a biased receiver. All pixels of a quad must have called `bias` before, as it may take screen derivatives.
float lit(ShadowCoord p) {
    if (!p.receiver.facing || p.axis_distance <= 0.0) return 1.0;
    // Casters in front of the near plane are stored at near; a bias larger than the receiver's depth would miss them.
    if (has_near_plane) p.bias = min(p.bias, max(from_near(p.depth) - depth_step, 0.0));
    if (beyond(p)) return visibility_beyond;
    p.linear -= p.bias / p.depth_per_length * p.linear_per_length;
#if GRADIENT_OF_RECEIVER == 1
    p.gradient = plane_gradient(p);  // a filter asks for the receiver's plane, and the bias has none
#endif
    if (GRADIENTS == 1) p.depth = stored_range(p.depth, p.bias + depth_step);
    return filter_visibility(p);
}
