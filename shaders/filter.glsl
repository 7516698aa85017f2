// The interface of a filter, a file that defines
//   float filter_visibility(ShadowCoord p)    visibility of a receiver
//   vec4 filter_contents(float depth)         with FILTER_CONTENTS (in Python `contents`): what the map stores for a caster at
//                                             a linear depth, which is negative for casters in front of the near plane
//   FILTER_HAS_PLANE                          if each texel is to be compared with the receiver's plane there
//   FILTER_HAS_REACH                          float filter_reach(ShadowCoord p) for the bias, in place of filter_radius
// by the functions below. Offsets are in texels, from the receiver's own point.
float compare_nearest(ShadowCoord p, vec2 offset);      // of the nearest texel: 1 lit, 0 in shadow
float compare_linear(ShadowCoord p, vec2 offset);       // of the four nearest, with bilinear weights
float plane_depth(ShadowCoord p, vec2 offset);          // linear depth of the receiver's plane; with FILTER_HAS_PLANE
vec3 to_texels(ShadowCoord p, vec4 v);                  // homogeneous texels of a point (w = 1) or direction (w = 0)
mat3 texels_across(ShadowCoord p);                      // lengths across the light's ray, in homogeneous texels
vec2 offset_across(mat3 across, vec2 lengths);          // the offset by two lengths
vec4 four_texels(MAP_SAMPLER map, ShadowCoord p, vec2 texel);  // the first component of a texel and those right of and above
                                                        // it, in textureGather's order
#ifdef FILTER_CONTENTS
vec4 contents_of_level(ShadowCoord p, vec2 offset, float level);
vec4 contents_at(ShadowCoord p, vec2 offset);           // what the filter stored there, blurred and from the mip levels
#endif
#include <filter>

mat3 texels_across(ShadowCoord p) {
    vec3 to_light = normalize(light.xyz - light.w * p.position);
    vec3 right = normalize(cross(abs(to_light.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), to_light));
    mat3 texels = mat3(to_texels(p, vec4(right, 0.0)), to_texels(p, vec4(cross(to_light, right), 0.0)),
                       to_texels(p, vec4(p.position, 1.0)));
    return mat3(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -map_size * p.uv, 1.0) * texels;  // from the receiver's point
}

vec2 offset_across(mat3 across, vec2 lengths) {
    vec3 texels = across * vec3(lengths, 1.0);
    return texels.xy / texels.z;
}

#if defined(FILTER_CONTENTS) && !defined(FILTER_MIPMAPPED)
vec4 contents_at(ShadowCoord p, vec2 offset) { return contents_of_level(p, offset, 0.0); }
#elif defined(FILTER_CONTENTS)
#include "footprint.glsl"

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
