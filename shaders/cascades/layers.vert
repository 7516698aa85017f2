// Casters on their way to cascades/layers.geom, which sees them once for each layer.
in vec3 position;
out vec3 world;

void main() { world = position; }
