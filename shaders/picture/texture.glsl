// The base colour that a texture gives a triangle, by the place of a position on it.
uniform sampler2DArray textures;    // sRGB, multiplied by alpha
uniform isampler2D texture_numbers; // by triangle: 1 + 9 · layer + 3 · the wrap of u + that of v; 0 for none
uniform sampler2D texture_maps;     // by triangle two texels: the gradients of u and of v, and their values at the origin
uniform vec3 forward;                   // along which the camera looks, unit
uniform vec3 pixel_right, pixel_up;     // a pixel's sides at a depth of 1

float wrapped(float at, int wrap) {
    if (wrap == 0) return at;  // by the sampler
    if (wrap == 1) at = 1.0 - abs(mod(at, 2.0) - 1.0);
    float half_texel = 0.5 / float(textureSize(textures, 0).x);
    return clamp(at, half_texel, 1.0 - half_texel);
}

vec3 linear(vec3 srgb) {
    return mix(pow((srgb + 0.055) / 1.055, vec3(2.4)), srgb / 12.92, lessThan(srgb, vec3(0.04045)));
}

// ray: from the eye to the position; normal: of the triangle.
vec3 texture_at(int triangle, vec3 position, vec3 ray, vec3 normal) {
    int number = texelFetch(texture_numbers, texel_of(triangle), 0).r - 1;
    if (number < 0) return vec3(1.0);
    ivec2 row = texel_of(triangle) * ivec2(2, 1);
    vec4 u = texelFetch(texture_maps, row, 0), v = texelFetch(texture_maps, row + ivec2(1, 0), 0);
    vec2 place = vec2(dot(u.xyz, position) + u.w, dot(v.xyz, position) + v.w);
    // How far the rays of the next pixels are apart on the triangle's plane; not by differences, which other triangles spoil.
    float depth = dot(ray, forward), cosine = dot(ray, normal);
    vec3 right = pixel_right * depth, up = pixel_up * depth;
    right -= ray * dot(right, normal) / cosine;
    up -= ray * dot(up, normal) / cosine;
    vec3 at = vec3(wrapped(place.x, number / 3 % 3), wrapped(place.y, number % 3), float(number / 9));
    vec4 texel = textureGrad(textures, at, vec2(dot(u.xyz, right), dot(v.xyz, right)), vec2(dot(u.xyz, up), dot(v.xyz, up)));
    return linear(texel.rgb / max(texel.a, 1.0 / 255.0));
}
