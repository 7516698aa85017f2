// Discards where a cut-out triangle is not opaque, if the program draws them.
#ifdef CUTOUTS
#include "cutout.glsl"
in Cutout { vec2 place; flat ivec2 face; } cutout;

void cut_out() { if (!is_opaque(cutout.face.x, cutout.place)) discard; }
int triangle_here() { return cutout.face.y; }
#else
void cut_out() {}
int triangle_here() { return gl_PrimitiveID; }
#endif
