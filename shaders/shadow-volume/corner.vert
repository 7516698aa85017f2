// Caster vertices for the geometry shaders that extrude them; equal ids are the same welded vertex.
in vec3 position;
out vec3 world;
flat out int id;

void main() {
    world = position;
    id = gl_VertexID;
}
