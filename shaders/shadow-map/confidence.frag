#include "shadow_map.glsl"
#include "history/texel.glsl"
out float confidence;

void main() { confidence = texel_confidence(bias(shadow_coord(receiver_here(), 0))); }
