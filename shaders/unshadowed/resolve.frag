// Reads the G-buffer as every technique does; everything is lit.
#include "receiver.glsl"
out float visibility;

void main() {
    Receiver r = receiver_here();
    visibility = r.facing ? 1.0 : min(1.0, 2.0 + r.cosine);
}
