// Shared by walls and caps of shadow volumes.
uniform vec4 light;  // w = 0: unit vector towards it; w = 1: its position
uniform mat4 world_to_clip;

vec4 clip_of(vec4 point) {
    precise vec4 clip = world_to_clip * point;
    return clip;
}

// From the light to a point, and on to infinity.
vec3 away(vec3 point) { return light.w * point - light.xyz; }
