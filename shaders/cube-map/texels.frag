// Texel of every pixel on its face, and the face; below 0 where there is no receiver.
#include "cube_map.glsl"
out vec4 texel;

void main() {
    Receiver r = receiver_here();
    ShadowCoord p = shadow_coord(r.position);
    texel = vec4(p.uv * map_size, r.facing ? float(p.layer) : -1.0, 1.0);
}
