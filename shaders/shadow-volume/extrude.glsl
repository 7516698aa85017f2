// Shared by walls and caps of shadow volumes. A wall or cap of weight n counts n times.
#include "shadow-volume/facing.glsl"
uniform mat4 world_to_clip;
uniform float sign_drawn;  // ±1: draws faces of that sign as many times as their weight; 0: draws all once
flat out float weight;

int times_drawn(float count) {
    if (sign_drawn == 0.0) return count == 0.0 ? 0 : 1;
    return int(max(sign_drawn * count, 0.0));
}

vec4 clip_of(vec4 point) {
    precise vec4 clip = world_to_clip * point;
    return clip;
}

// A point's projection from the light to infinity.
vec4 away(vec3 point) { return vec4(light.w * point - light.xyz, 0.0); }
