// Shadow coordinates of a receiver in a map of one or more layers (LAYERS). Depths are the map's, in [0, 1], with REVERSED
// increasing towards the light. SIZE is the parameter of that name. MAP_PARALLEL: of a directional light only.
// cube_map.glsl has its own shadow_coord.
#include "receiver.glsl"
#ifndef LAYERS
#define LAYERS 1
#endif
#ifndef REVERSED
#define REVERSED 0
#endif
uniform float filter_radius;  // largest distance of a compared texel's points from the receiver's point, in texels
uniform float depth_step;     // spacing of stored depths near 1
uniform float position_step;  // float32 rounding error of positions, a local length
uniform float subpixel;       // step of the rasteriser's grid, in texels of the map

const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;
const float map_size = float(SIZE);

struct ShadowCoord {
    vec3 position;           // of the receiver, offset by the bias
    vec3 normal;             // of the receiver
    vec2 uv;                 // in the layer, [0, 1]
    int layer;               // of an array, face of a cube
    float depth;
    vec3 axis;               // unit vector of decreasing depth, towards the light's plane, or a cube map's light
    float axis_distance;     // from the light along that axis; 1 for a directional light
    float depth_per_length;  // derivative of depth along that axis, per local length
    float linear;            // depth along the axis, less the bias: 0 at the near plane, 1 at the far plane
    float linear_per_length; // derivative of linear depth along the axis, per local length
    vec2 texel;              // size of a texel at the receiver, in local lengths
    float step;              // resolution of the comparison of stored and computed depths
    float radius;            // filter_radius, unless the filter computes its own
    float bias;              // subtracted from the depth, in depth units
    vec2 gradient;           // of the receiver's depth over uv
};

// The larger of the format's step and the rounding error of positions, which dominates over a short depth range.
float step_of_depth(float depth_per_length) { return max(depth_step, position_step * depth_per_length); }

// Sine of the angle between the surface's normal and the direction of the map's depth. For a directional light and for a
// cube map, whose depth is the distance, that angle is θ, between N and L. For a spot it differs from θ off the axis,
// where the map's depth varies even over a surface that faces the light.
float sin_slope(Receiver r, ShadowCoord p) {
    float along = dot(r.normal, p.axis);
    return sqrt(max(1.0 - along * along, 0.0));
}

// Change of the distance along the axis per length across the map: on the plane N·P = c the distance in direction
// d (d·axis = 1) is c/(N·d), and its gradient is |N perpendicular to the axis| · distance/(N·d).
float tan_slope(Receiver r, ShadowCoord p) {
    return sin_slope(r, p) * p.axis_distance / (r.distance * max(r.cosine, 1e-6));
}

#ifndef MAP_CUBE
uniform mat4 world_to_map[LAYERS];
uniform mat4 map_to_world[LAYERS];
uniform vec4 world_to_linear[LAYERS];  // dot product with a position (w = 1) gives the linear depth
uniform vec2 texel_width[LAYERS];   // size of a texel in local lengths; for a spot at unit distance along its axis
uniform float depth_scale[LAYERS];  // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform vec3 light_axis;            // unit vector along the light's axis, pointing back to the light

ShadowCoord shadow_coord(vec3 position, int layer) {
    ShadowCoord p;
    p.position = position;
    vec4 projected = world_to_map[layer] * vec4(position, 1.0);
#ifdef MAP_PARALLEL
    projected.w = 1.0;  // it is; known to the compiler it saves all that depends on it
#endif
    p.uv = projected.xy / projected.w;
    p.layer = layer;
    p.depth = projected.z / projected.w;
    p.axis = light_axis;
    p.axis_distance = projected.w;
    p.depth_per_length = depth_scale[layer] / (projected.w * projected.w);
    p.linear = dot(world_to_linear[layer], vec4(position, 1.0));
    p.linear_per_length = length(world_to_linear[layer].xyz);
    p.step = step_of_depth(p.depth_per_length);
    p.texel = texel_width[layer] * projected.w;
    p.radius = filter_radius;
    return p;
}

// A world-space plane (N, −N·P) in the layer's map space: planes transform by the inverse transpose.
vec4 plane_in_map(vec4 plane, ShadowCoord p) { return plane * map_to_world[p.layer]; }

// Gradient over uv of the depth of the receiver's plane, which is constant over the map, for a spot too.
vec2 plane_gradient(Receiver r, ShadowCoord p) {
    vec4 plane = plane_in_map(vec4(r.normal, -dot(r.normal, r.position)), p);
    return plane.z == 0.0 ? vec2(0.0) : -plane.xy / plane.z;
}
#endif
