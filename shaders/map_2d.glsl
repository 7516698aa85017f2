// Where a receiver lies in a 2-D depth map. Needs SIZE, and REVERSED 0 or 1.
// All depths are the map's own, in [0, 1], growing towards the light where REVERSED.
#include "receiver.glsl"
uniform mat4 world_to_map;
uniform mat4 map_to_world;
uniform vec2 texel_width;  // local lengths of a texel; for a spot at unit distance along its axis
uniform vec3 light_axis;   // unit vector from the map's plane back towards the light
uniform float depth_scale; // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform float depth_step;  // spacing of stored depths near 1

const float depth_sign = REVERSED == 1 ? -1.0 : 1.0;
const float map_size = float(SIZE);

struct MapPoint {
    vec2 uv;
    float depth;
    float axis_distance;     // along the light's axis; 1 for a directional light
    float depth_per_length;  // along the light's axis, in local lengths
    vec2 texel;              // local lengths of a texel at the receiver
    float bias;              // subtracted from the depth, in depth units
    vec2 gradient;           // of the receiver's depth over uv
};

MapPoint map_point(vec3 position) {
    MapPoint p;
    vec4 projected = world_to_map * vec4(position, 1.0);
    p.uv = projected.xy / projected.w;
    p.depth = projected.z / projected.w;
    p.axis_distance = projected.w;
    p.depth_per_length = depth_scale / (projected.w * projected.w);
    p.texel = texel_width * projected.w;
    p.bias = 0.0;
    p.gradient = vec2(0.0);
    return p;
}
