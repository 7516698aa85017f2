// Texel of every pixel in the map, and the layer; below 0 outside.
#include "shadow_map.glsl"
out vec4 texel;

void main() {
    Receiver r = receiver_here();
    ShadowCoord p = shadow_coord(r.position, 0);
    bool inside = r.facing && clamp(p.uv, 0.0, 1.0) == p.uv;
    texel = vec4(p.uv * map_size, inside ? 0.0 : -1.0, 1.0);
}
