// An edge.
#include "hybrid/silhouette/nearest.glsl"

void main() { store_nearest(); }
