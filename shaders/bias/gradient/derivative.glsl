// By screen derivatives, as published: of one surface only where a pixel quad sees one.
vec2 bias_gradient(ShadowCoord p) {
    vec3 dx = dFdx(vec3(p.uv, p.depth));
    vec3 dy = dFdy(vec3(p.uv, p.depth));
    float determinant = dx.x * dy.y - dx.y * dy.x;
    vec2 gradient = vec2(dy.y * dx.z - dx.y * dy.z, dx.x * dy.z - dy.x * dx.z) / determinant;
    return determinant == 0.0 ? vec2(0.0) : gradient;
}
