// Compares each texel with the receiver's plane at the texel's centre (Isidoro 2006, but with the plane of the geometric
// normal instead of screen derivatives, which are wrong where two surfaces meet in a pixel quad).
#include "units.glsl"
uniform float bias_limit;
uniform float bias_slack;
uniform float bias_ulps;

vec2 bias_gradient(ShadowCoord p) {
#ifdef BIAS_GRADIENT_PLANE
    return plane_gradient(p);
#else
    // By screen derivatives, as published: of one surface only where a pixel quad sees one.
    vec3 dx = dFdx(vec3(p.uv, p.depth));
    vec3 dy = dFdy(vec3(p.uv, p.depth));
    float determinant = dx.x * dy.y - dx.y * dy.x;
    vec2 gradient = vec2(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / determinant;
    return determinant == 0.0 ? vec2(0.0) : gradient;
#endif
}

ShadowCoord bias(ShadowCoord p) {
    p.gradient = bias_gradient(p) * min(1.0, bias_limit / max(tan_slope(p), 1e-6));
    // The texel's centre may be on a neighbouring triangle that is nearer to the light. Corners are snapped by up to half a
    // step of the rasteriser's grid along each axis, which moves stored depths by as much of the slope.
    vec2 slope = abs(p.gradient) / map_size;
    float snapped = 0.5 * subpixel * (slope.x + slope.y);
    p.bias += bias_slack * max(p.texel.x, p.texel.y) * p.depth_per_length + snapped + bias_ulps * resolution(p);
    return p;
}
