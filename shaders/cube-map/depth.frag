// Distance to the light, linear in [0, 1].
in vec3 away;
uniform float map_far;

void main() { gl_FragDepth = length(away) / map_far; }
