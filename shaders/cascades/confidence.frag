#include "cascades/select.glsl"
#include "history/texel.glsl"
out float confidence;

void main() { confidence = texel_confidence(bias(cascade_of(receiver_here()).coord)); }
