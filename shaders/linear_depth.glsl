// Depth that is linear along the light's axis, for spots too, as needed for blurred depths and moments. w: distance along
// the axis, 1 for a directional light; 1 / gl_FragCoord.w of a caster, axis_distance of a receiver.
uniform float far_distance;  // w at the far plane

float linear_depth(float depth, float w) { return clamp(depth * w / far_distance, 0.0, 1.0); }
