uniform mat4 world_to_clip;

vec4 clip_of(vec3 position) { return world_to_clip * vec4(position, 1.0); }
