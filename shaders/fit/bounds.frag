// One step of a min-max reduction of REACH² texels to one, with REACH even, of GROUPS of four values, one to a layer:
// positions along four directions each. Input: FROM_SAMPLE, the receiver of one pixel; FROM_RECEIVERS, all visible
// receivers, but read only where the depths of REACH² pixels say that these may extend the bounds of the sample
// (Lauritzen, Salvi and Lefohn 2011 read all); FROM_VALUES, a texture; else the results of the previous step.
layout(location = 0) out vec4 low[GROUPS];
layout(location = GROUPS) out vec4 high[GROUPS];
const float nothing = 3.0e38;

void include(int group, vec4 a, vec4 b) {
    low[group] = min(low[group], a);
    high[group] = max(high[group], b);
}

#if defined(FROM_SAMPLE) || defined(FROM_RECEIVERS)
#include "receiver.glsl"
uniform mat4 world_to_light;
uniform float perspective;        // 1: x and y are divided by the distance along the axis
uniform float cos_half_angle;     // of a spot's cone; −1 for other lights
uniform mat4 directions[GROUPS];  // rows: unit vectors in light space across the light's axis, or (0, 0, 1, 0) along it

void include_receiver(ivec2 pixel) {
    Receiver r = receiver_at(min(pixel, textureSize(surface_position, 0) - 1));
    vec3 p = (world_to_light * vec4(r.position, 1.0)).xyz;
    p = vec3(perspective > 0.5 ? p.xy / -p.z : p.xy, -p.z);
    // The third row of the matrix is the light's axis, pointing back to the light.
    vec3 back = vec3(world_to_light[0].z, world_to_light[1].z, world_to_light[2].z);
    bool receives = r.facing && dot(back, r.to_light) >= cos_half_angle;
    if (!receives) return;
    for (int i = 0; i < GROUPS; ++i) include(i, directions[i] * vec4(p, 0.0), directions[i] * vec4(p, 0.0));
}
#endif

#ifdef FROM_RECEIVERS
uniform sampler2D surface_depth;  // view depth as a share of the far plane's; 1 where no surface is visible
uniform sampler2DArray lows;      // bounds of the sample, one texel
uniform sampler2DArray highs;
uniform mat4 pixel_to_light;      // (pixel · spread, depth, 1) to light space, with the distance along the axis for z
uniform vec4 eye;                 // w = 1: the spread of rays is their depth; w = 0: 1
uniform float rounding;           // exceeds the error of that by rounding

vec4 row(int i) { return vec4(pixel_to_light[0][i], pixel_to_light[1][i], pixel_to_light[2][i], pixel_to_light[3][i]); }

// Whether `plane` · (pixel · spread, depth, 1) may exceed `scale` · rounding in a block of pixels and depths; conservative
// by half a pixel on each side.
bool may_exceed(vec4 plane, float scale, vec2 start, vec2 depths) {
    vec2 first = plane.xy * (start - 0.5), last = plane.xy * (start + float(REACH) - 0.5);
    vec2 across = (max(first.x, last.x) + max(first.y, last.y)) * mix(vec2(1.0), depths, eye.w), along = plane.z * depths;
    return max(across.x + along.x, across.y + along.y) + plane.w > -scale * rounding;
}

// Whether a block with surfaces between two depths may extend the bounds.
bool may_extend(vec2 start, vec2 depths) {
    vec4 x = row(0), y = row(1), z = row(2), one = perspective > 0.5 ? z : vec4(0.0, 0.0, 0.0, 1.0);
    if (cos_half_angle > 0.01) {  // a block outside the pyramid around a spot's cone has no receivers
        float slope = sqrt(1.0 - cos_half_angle * cos_half_angle) / cos_half_angle, scale = 1.0 + slope;
        bool right = may_exceed(slope * z + x, scale, start, depths), left = may_exceed(slope * z - x, scale, start, depths);
        bool above = may_exceed(slope * z + y, scale, start, depths), below = may_exceed(slope * z - y, scale, start, depths);
        if (!right || !left || !above || !below) return false;
    }
    if (low[0].x > high[0].x) return true;  // no receiver in the sample
    bool extends = perspective > 0.5 && may_exceed(-z, 1.0, start, depths);  // behind the light
    for (int i = 0; i < GROUPS; ++i)
        for (int j = 0; j < 4; ++j) {
            vec3 direction = vec3(directions[i][0][j], directions[i][1][j], directions[i][2][j]);
            vec4 along = direction.x * x + direction.y * y + direction.z * z;
            vec4 unit = direction.z > 0.0 ? vec4(0.0, 0.0, 0.0, 1.0) : one;
            float largest = direction.z > 0.0 ? 1.0 : 1.0 + max(abs(low[i][j]), abs(high[i][j]));
            extends = extends || may_exceed(low[i][j] * unit - along, largest, start, depths)
                || may_exceed(along - high[i][j] * unit, largest, start, depths);
        }
    return extends;
}

// The result is that of reading all receivers.
void include_texels(ivec2 start) {
    for (int i = 0; i < GROUPS; ++i) {
        low[i] = textureLod(lows, vec3(0.5, 0.5, i), 0.0);
        high[i] = textureLod(highs, vec3(0.5, 0.5, i), 0.0);
    }
    vec2 size = vec2(textureSize(surface_depth, 0)), depths = vec2(1.0, 0.0);
    for (int y = 1; y < REACH; y += 2)
        for (int x = 1; x < REACH; x += 2) {
            vec4 four = textureGather(surface_depth, vec2(start + ivec2(x, y)) / size);
            vec4 seen = mix(four, vec4(0.0), equal(four, vec4(1.0)));
            depths.x = min(depths.x, min(min(four.x, four.y), min(four.z, four.w)));
            depths.y = max(depths.y, max(max(seen.x, seen.y), max(seen.z, seen.w)));
        }
    int texels = depths.x < 1.0 && may_extend(vec2(start), depths) ? REACH * REACH : 0;
    for (int i = 0; i < texels; ++i) include_receiver(start + ivec2(i % REACH, i / REACH));
}
#elif defined(FROM_SAMPLE)
void include_texels(ivec2 start) { include_receiver(start + REACH / 2); }
#else
#ifdef FROM_VALUES
uniform sampler2D values;
#define lows values
#define highs values
#define AT(place, group) place
#else
uniform sampler2DArray lows;
uniform sampler2DArray highs;
#define AT(place, group) vec3(place, group)
#endif

void include_texels(ivec2 start) {
    ivec2 size = textureSize(lows, 0).xy, stop = min(start + REACH, size);
    for (int y = start.y; y < stop.y; ++y)
        for (int x = start.x; x < stop.x; ++x) {
            vec2 at = (vec2(x, y) + 0.5) / vec2(size);
            for (int i = 0; i < GROUPS; ++i)
                include(i, textureLod(lows, AT(at, i), 0.0), textureLod(highs, AT(at, i), 0.0));
        }
}
#endif

void main() {
    for (int i = 0; i < GROUPS; ++i) {
        low[i] = vec4(nothing);
        high[i] = vec4(-nothing);
    }
    include_texels(ivec2(gl_FragCoord.xy) * REACH);
}
