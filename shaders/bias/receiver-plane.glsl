// Compares each texel with the receiver's plane at the texel's centre (Isidoro 2006, but with the plane of the geometric
// normal instead of screen derivatives, which are wrong where two surfaces meet in a pixel quad).
#define BIAS_HAS_GRADIENT
#define BIAS_HAS_DEPTH
uniform float bias_limit;
uniform float bias_slack;
uniform float bias_ulps;

vec2 bias_gradient(Receiver r, ShadowCoord p) {
#ifdef BIAS_GRADIENT_DERIVATIVE
    vec3 dx = dFdx(vec3(p.uv, p.depth));
    vec3 dy = dFdy(vec3(p.uv, p.depth));
    float determinant = dx.x * dy.y - dx.y * dy.x;
    vec2 gradient = vec2(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / determinant;
    if (determinant == 0.0) gradient = vec2(0.0);
#else
    vec2 gradient = plane_gradient(r, p);
#endif
    return gradient * min(1.0, bias_limit / max(tan_slope(r, p), 1e-6));
}

float bias_depth(Receiver r, ShadowCoord p) {
    // The texel's centre may be on a neighbouring triangle that is nearer to the light. Corners are snapped by up to half a
    // step of the rasteriser's grid along each axis, which moves stored depths by as much of the slope.
    vec2 slope = abs(bias_gradient(r, p)) / map_size;
    float snapped = 0.5 * subpixel * (slope.x + slope.y);
    return bias_slack * max(p.texel.x, p.texel.y) * p.depth_per_length + snapped + bias_ulps * p.step;
}
