// Linear depth of an edge or a cut-out, unless a caster hides it from the light: unless it is behind all depths that are
// stored around it.
in vec3 point;
#include "hybrid/silhouette/depth-<map>.glsl"

void store_nearest() {
    float nearest = depth() - fwidth(depth());  // within the texel
    vec4 farthest = vec4(-1e30);
    for (int corner = 0; corner < 4; ++corner)
        farthest = max(farthest, stored_around(gl_FragCoord.xy + vec2(corner % 2, corner / 2) - 0.5));
    if (nearest > max(max(farthest.x, farthest.y), max(farthest.z, farthest.w))) discard;
    gl_FragDepth = clamp(nearest, 0.0, 1.0);
}
