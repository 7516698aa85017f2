// Caster vertices for the geometry shader that draws wedges; equal ids are the same welded vertex.
in vec3 position;
out vec3 world;
flat out int id;

void main() {
    world = position;
    id = gl_VertexID;
}
