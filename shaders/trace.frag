// A ray to the light for each pixel that the depth test lets through.
#include "receiver.glsl"
#include "tree.glsl"
uniform float offset;  // height of a ray's start above its receiver, a local length
out float visibility;

void main() {
    Receiver r = receiver_here();
    float ahead = offset / max(r.cosine, 1e-6);
    float reach = light.w == 0.0 ? INFINITE : r.distance - ahead;
    if (!r.facing) reach = 0.0;
    visibility = occluded(r.position + r.to_light * ahead, r.to_light, reach) ? 0.0 : 1.0;
}
