// A caster's corner, for the geometry shaders that extrude. Its index names the welded vertex.
in vec3 position;
out vec3 world;
flat out int id;

void main() {
    world = position;
    id = gl_VertexID;
}
