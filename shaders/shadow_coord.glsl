// The point of a receiver in a map of one or more layers. SIZE is the parameter of that name.
#include "receiver.glsl"
uniform float depth_step;     // spacing of stored depths near 1
uniform float position_step;  // float32 rounding error of positions, a local length
const float map_size = float(SIZE);

struct ShadowCoord {
    Receiver receiver;
    vec3 position;            // of the receiver, as moved by the bias
    int layer;                // of an array, face of a cube
    vec2 uv;                  // in the layer, [0, 1]
    float depth;              // as stored, in [0, 1]
    float bias;               // how much nearer to the light it is taken to be
    vec2 gradient;            // of the depth over uv that texels are compared with
    vec3 axis;                // unit vector of decreasing depth, towards the light's plane, or a cube map's light
    float axis_distance;      // from the light along that axis; 1 for a directional light
    float depth_per_length;   // derivative of depth along that axis, per local length
    float linear;             // depth along the axis: 0 at the near plane, 1 at the far plane; for a filter less the bias
    float linear_per_length;  // derivative of linear depth along the axis, per local length
    vec2 texel;               // size of a texel at the receiver, in local lengths
};
