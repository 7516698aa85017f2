// Casters relative to the light, for faces.geom.
in vec3 position;
out vec3 from_light;
uniform vec3 light_position;

void main() { from_light = position - light_position; }
