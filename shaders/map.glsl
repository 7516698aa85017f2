// Where a receiver lies in a layer of 2-D depth maps. Needs LAYERS, and MAP_ARRAY where they are an array texture.
#include "map_point.glsl"
uniform mat4 world_to_map[LAYERS];
uniform mat4 map_to_world[LAYERS];
uniform vec2 texel_width[LAYERS];   // local lengths of a texel; for a spot at unit distance along its axis
uniform float depth_scale[LAYERS];  // depth per local length along the axis: 1/(far − near); for a spot f·n/(f − n)
uniform vec3 light_axis;            // unit vector from the map's plane back towards the light

MapPoint map_point(vec3 position, int layer) {
    MapPoint p;
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
    p.bias = 0.0;
    p.gradient = vec2(0.0);
    return p;
}

// Of a world-space plane (N, −N·P), in the layer's own space: a plane maps by the inverse transpose.
vec4 plane_in_map(vec4 plane, MapPoint p) { return plane * map_to_world[p.layer]; }
