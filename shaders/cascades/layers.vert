// Casters in world space for cascades/layers.geom, which projects them into each layer.
in vec3 position;
out vec3 world;

void main() { world = position; }
