// A ray to the light for each pixel that the depth test lets through.
#include "receiver.glsl"
#include "tree.glsl"
uniform float offset;  // height of a ray's start above its receiver, a local length
#ifdef REACHES
uniform sampler2D reaches;  // of the rays, local lengths
#endif
out float visibility;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Receiver r = receiver_at(pixel);
    float ahead = offset / max(r.cosine, 1e-6);
    float reach = light.w == 0.0 ? INFINITE : r.distance - ahead;
#ifdef REACHES
    reach = min(reach, texelFetch(reaches, pixel, 0).r);
#endif
    if (!r.facing) reach = 0.0;
    visibility = occluded(r.position + r.to_light * ahead, r.to_light, reach) ? 0.0 : 1.0;
}
