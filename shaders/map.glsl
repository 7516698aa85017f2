// Points of a shadow map, of a sun or a spot unless another projection is chosen.
#include "projection/<projection>.glsl"

ShadowCoord shadow_coord(Receiver r, int layer) {
    ShadowCoord p;
    p.receiver = r;
    p.position = r.position;
    p.layer = layer;
    p.bias = 0.0;
    return projected(p);
}

ShadowCoord moved(ShadowCoord p, vec3 offset) {
    p.position += offset;
    return projected(p);
}
