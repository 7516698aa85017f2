// The normal that a pixel is shaded by: of the smooth surface if the scene has any, on the side of the geometric one.
#include "receiver.glsl"
#ifdef SMOOTH
uniform sampler2D surface_shading_normal;

vec3 shading_normal(Receiver r) { return textureLod(surface_shading_normal, r.at, 0.0).xyz; }
#else
vec3 shading_normal(Receiver r) { return r.normal; }
#endif
