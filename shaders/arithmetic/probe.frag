// Results whose last bits differ between processors for which a driver compiles: of multiplying and adding in one
// rounding or two, and of functions that OpenGL lets drivers approximate.
in vec3 point;
out vec4 results;

void main() {
    vec3 x = point, y = point.yzx * 1.3 + 0.7;
    vec4 rows[4] = vec4[4](
        vec4(x.x * y.x + x.y, dot(x, y), length(cross(x, y)), x.x * y.y - x.y * y.x),
        vec4(1.0 / y.x, inversesqrt(abs(y.y)), sqrt(abs(y.z)), y.x / y.z),
        vec4(sin(x.x), exp2(x.y), log2(abs(y.z)), pow(abs(y.x), 1.7)),
        vec4(x, gl_FragCoord.w));
    results = rows[int(gl_FragCoord.y) & 3];
}
