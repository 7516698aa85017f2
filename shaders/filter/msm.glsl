// Moment shadow maps (Peters and Klein 2015): Hamburger 4MSM.
#include "filter/chebyshev.glsl"
uniform float filter_bias;
uniform float filter_bleed;
// Depths in [0, 1] are stored as [−margin, margin] of [−1, 1], as moments of the ends are singular.
const float margin = 0.98;

float inner(float depth) { return margin * (2.0 * clamp(depth, 0.0, 1.0) - 1.0); }

#if FILTER_BITS == 16
// Peters's quantisation transform of moments of [−1, 1], odd and even, by which they use the range of 16-bit unorm. Mipmaps
// and blurs commute with it, as it is affine.
vec4 to_stored(vec4 b) {
    vec2 odd = mat2(1.5, sqrt(3.0) / 2.0, -2.0, -2.0 / sqrt(27.0)) * b.xz + 0.5, even = mat2(4.0, 0.5, -4.0, 0.5) * b.yw;
    return vec4(odd.x, even.x, odd.y, even.y);
}
vec4 from_stored(vec4 q) {
    vec2 odd = mat2(-1.0 / 3.0, -0.75, sqrt(3.0), 0.75 * sqrt(3.0)) * (q.xz - 0.5), even = mat2(0.125, -0.125, 1.0, 1.0) * q.yw;
    return vec4(odd.x, even.x, odd.y, even.y);
}
const float published_bias = 6e-5;
#else
vec4 to_stored(vec4 b) { return b; }
vec4 from_stored(vec4 b) { return b; }
const float published_bias = 3e-6;
#endif

vec4 filter_contents(float depth) {
    float z = inner(depth);
    return to_stored(vec4(z, z * z, z * z * z, z * z * z * z));
}

// The share of depths nearer than z that any distribution with these moments has at least.
float least_shadow(vec4 b, float z) {
    // LDLᵀ factorisation of the Hankel matrix B = [1 b1 b2; b1 b2 b3; b2 b3 b4], and B c = (1, z, z²).
    float l21_d22 = b.z - b.x * b.y, d22 = b.y - b.x * b.x;
    float squared_variance = b.w - b.y * b.y;
    float d33_d22 = dot(vec2(squared_variance, -l21_d22), vec2(d22, l21_d22));
    float inverse_d22 = 1.0 / d22, l32 = l21_d22 * inverse_d22;
    vec3 c = vec3(1.0, z, z * z);
    c.y -= b.x;
    c.z -= b.y + l32 * c.y;
    c.y *= inverse_d22;
    c.z *= d22 / d33_d22;
    c.y -= l32 * c.z;
    c.x -= dot(c.yz, b.xy);
    // The roots of c.x + c.y x + c.z x² are the other two depths of the distribution.
    float half_sum = -0.5 * c.y / c.z;
    float distance = sqrt(max(half_sum * half_sum - c.x / c.z, 0.0));
    float near = half_sum - distance, far = half_sum + distance;
    if (z <= near) return 0.0;
    if (z <= far) {
        return (z * far - b.x * (z + far) + b.y) / ((far - near) * (z - near));
    }
    return 1.0 - (near * far - b.x * (near + far) + b.y) / ((z - near) * (z - far));
}

float filter_visibility(ShadowCoord p) {
    float bias = filter_bias > 0.0 ? filter_bias : published_bias;
    vec4 b = mix(from_stored(contents_at(p, vec2(0.0))), vec4(0.0, 0.5, 0.0, 0.5), bias);
    return less_bleeding(1.0 - clamp(least_shadow(b, inner(p.linear)), 0.0, 1.0), filter_bleed);
}
