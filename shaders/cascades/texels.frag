// Texel of every pixel in its cascade's map, and the cascade; below 0 outside.
#include "cascades/select.glsl"
out vec4 texel;

void main() {
    Receiver r = receiver_here();
    ShadowCoord p = shadow_coord(r, cascade_of(r).coord.layer);
    bool inside = r.facing && clamp(p.uv, 0.0, 1.0) == p.uv;
    texel = vec4(p.uv * map_size, inside ? float(p.layer) : -1.0, 1.0);
}
