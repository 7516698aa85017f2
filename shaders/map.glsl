// Points of a shadow map of one or more layers: SIZE is the parameter of that name, LAYERS and REVERSED are 1 and 0 unless
// they are defined otherwise.
#include "receiver.glsl"
uniform float depth_step;     // spacing of stored depths near 1
uniform float position_step;  // float32 rounding error of positions, a local length
const float map_size = float(SIZE);
const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;  // reversed, depth is 1 at the near plane and 0 at the far plane

float from_near(float depth) { return REVERSED == 1 ? 1.0 - depth : depth; }

// A receiver's depth, clamped as stored depths are: before the near plane it is not in front of casters clamped to it.
float stored_range(float depth, float front) {
    return REVERSED == 1 ? clamp(depth, 0.0, 1.0 - front) : clamp(depth, front, 1.0);
}

struct ShadowCoord {
    Receiver receiver;
    vec3 position;            // of the receiver, as moved by the bias
    int layer;                // of an array, face of a cube
    vec2 uv;                  // in the layer, [0, 1]
    float depth;              // as stored, in [0, 1]
    float bias;               // how much nearer to the light it is taken to be
    vec2 gradient;            // of the depth over uv that texels are compared with
    float slack;     // added to the bias for each texel along both sides to a texel's centre
    float longest;            // change of depth by which two planes that differ are extended at most
    vec3 axis;                // unit vector of decreasing depth, towards the light's plane, or a cube map's light
    float axis_distance;      // from the light along that axis; 1 for a directional light
    float depth_per_length;   // derivative of depth along that axis, per local length
    float linear;             // depth along the axis: 0 at the near plane, 1 at the far plane; for a filter less the bias
    float linear_per_length;  // derivative of linear depth along the axis, per local length
    vec2 texel;               // size of a texel at the receiver, in local lengths
};

struct Texel {
    float depth;    // as stored
    vec2 offset;    // from the receiver's point to where it is read, in texels; to its centre, if compared one by one
    vec2 gradient;  // with GRADIENTS: of the triangle that is stored; see gradient.glsl
};

vec2 unpacked(uint gradient) { return vec2(uintBitsToFloat(gradient << 16), uintBitsToFloat(gradient & 0xFFFF0000u)); }

// A kind of map, of a sun or a spot unless it is chosen otherwise: a file that defines
//   ShadowCoord projected(ShadowCoord p)             the point of p.position in layer p.layer
//   MAP_SAMPLER map_depths, lookup(p, offset)        the map, and its texture coordinates; offsets are in texels
//   Texel nearest_texel(ShadowCoord p, vec2 offset)
//   Texel[4] texels_around(ShadowCoord p, vec2 corner)     from the one at these texels of the map, right first
//   float hardware_comparison(ShadowCoord p, vec2 offset, float depth)
//   float plane_depth(ShadowCoord p, vec2 offset)          linear depth of the receiver's plane, less the bias
//   float receiver_change(ShadowCoord p, Texel t)          of depth on the receiver's plane to the texel's centre
//   float caster_change(ShadowCoord p, Texel t)            of depth on the stored triangle's plane, the same way
//   vec2 plane_gradient(ShadowCoord p)                     of depth over uv on the receiver's plane; 0 for a cube
//   vec3 to_texels(ShadowCoord p, vec4 v)                  homogeneous texels of a point (w = 1) or direction (w = 0)
#include "map/<projection>.glsl"

ShadowCoord shadow_coord(Receiver r, int layer) {
    ShadowCoord p;
    p.receiver = r;
    p.position = r.position;
    p.layer = layer;
    p.bias = 0.0;
    return projected(p);
}

// The offset of the centre of the texel at an offset.
vec2 to_centre(ShadowCoord p, vec2 offset) { return floor(p.uv * map_size + offset) + 0.5 - p.uv * map_size; }

ShadowCoord moved(ShadowCoord p, vec3 offset) {
    p.position += offset;
    return projected(p);
}
