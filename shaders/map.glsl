// Where a receiver lies in a shadow map, of one layer or several (LAYERS). All depths are the map's own, in [0, 1], growing
// towards the light where REVERSED. SIZE comes from the parameter of that name; cube_map.glsl has a shadow_coord of its own.
#include "receiver.glsl"
#ifndef LAYERS
#define LAYERS 1
#endif
#ifndef REVERSED
#define REVERSED 0
#endif
uniform float filter_radius;  // texels that a compared texel reaches from the receiver's point
uniform float depth_step;     // spacing of stored depths near 1
uniform float position_step;  // local length that float32 rounds positions by

const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;
const float map_size = float(SIZE);

struct ShadowCoord {
    vec2 uv;                 // in the layer, [0, 1]
    int layer;               // of an array, face of a cube
    float depth;
    vec3 axis;               // unit vector along which depth decreases, back to the light; of a cube to the lamp itself
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

// Of the angle between the surface and what the map's depth grows along. For a directional light and for a cube, whose
// depth is the distance, that is θ, the angle between N and L; for a spot it differs from θ off the axis, where even a
// surface that faces the light changes its depth in the map.
float sin_slope(Receiver r, ShadowCoord p) {
    float along = dot(r.normal, p.axis);
    return sqrt(max(1.0 - along * along, 0.0));
}

// Depth along the axis that the surface gains for each length across the map: on the plane N·P = c seen in direction
// d (d·axis = 1) the depth is c/(N·d), and its gradient is |N across the axis| · depth/(N·d).
float tan_slope(Receiver r, ShadowCoord p) {
    return sin_slope(r, p) * p.axis_distance / (r.distance * max(r.cosine, 1e-6));
}

#ifndef MAP_CUBE
uniform mat4 world_to_map[LAYERS];
uniform mat4 map_to_world[LAYERS];
uniform vec2 texel_width[LAYERS];   // local lengths of a texel; for a spot at unit distance along its axis
uniform float depth_scale[LAYERS];  // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform vec3 light_axis;            // unit vector from the map's plane back towards the light

ShadowCoord shadow_coord(vec3 position, int layer) {
    ShadowCoord p;
    vec4 projected = world_to_map[layer] * vec4(position, 1.0);
    p.uv = projected.xy / projected.w;
    p.layer = layer;
    p.depth = projected.z / projected.w;
    p.axis = light_axis;
    p.axis_distance = projected.w;
    p.depth_per_length = depth_scale[layer] / (projected.w * projected.w);
    p.step = step_of_depth(p.depth_per_length);
    p.texel = texel_width[layer] * projected.w;
    p.radius = filter_radius;
    return p;
}

// Of a world-space plane (N, −N·P), in the layer's own space: a plane maps by the inverse transpose.
vec4 plane_in_map(vec4 plane, ShadowCoord p) { return plane * map_to_world[p.layer]; }
#endif
