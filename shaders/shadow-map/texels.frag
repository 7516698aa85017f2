// Texel of every pixel in the map, and the layer or face; below 0 outside.
#include "shadow_map.glsl"
out vec4 texel;

void main() {
    ShadowCoord p = shadow_coord(receiver_here(), 0);
    bool inside = p.receiver.facing && clamp(p.uv, 0.0, 1.0) == p.uv;
    texel = vec4(p.uv * map_size, inside ? float(p.layer) : -1.0, 1.0);
}
