// Where a receiver lies in a depth map of any kind. Needs SIZE, and REVERSED 0 or 1.
// All depths are the map's own, in [0, 1], growing towards the light where REVERSED.
#include "receiver.glsl"
uniform float filter_radius;  // texels that a compared texel reaches from the receiver's point
uniform float depth_step;     // spacing of stored depths near 1
uniform float position_step;  // local length that float32 rounds positions by

const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;
const float map_size = float(SIZE);

struct MapPoint {
    vec2 uv;                 // in the layer, [0, 1]
    int layer;               // of an array, face of a cube
    float depth;
    vec3 axis;               // unit vector along which depth decreases: from the map's plane back towards the light;
                             // for a cube, which stores distances, to the light itself
    float axis_distance;     // along that axis; 1 for a directional light
    float depth_per_length;  // along that axis, in local lengths
    vec2 texel;              // local lengths of a texel at the receiver
    float step;              // of depth, that stored and computed depths are told apart by
    float radius;            // filter_radius, unless the filter has a reach of its own
    float bias;              // subtracted from the depth, in depth units
    vec2 gradient;           // of the receiver's depth over uv
};

// The format's step, or what rounded positions make of it: over the short range of a floor square to the light, the more.
float step_of_depth(float depth_per_length) { return max(depth_step, position_step * depth_per_length); }
