// FXAA (Lottes 2009), its short search along the edge, where surfaces meet and nowhere else: the steps of a shadow's edge
// are what is measured, and stay as they are.
uniform sampler2D shaded;
uniform sampler2D surface_position;
uniform sampler2D surface_normal;
out vec4 color;

bool meets_another(ivec2 pixel) {
    vec4 here = texelFetch(surface_position, pixel, 0);
    vec3 normal = texelFetch(surface_normal, pixel, 0).xyz;
    ivec2 last = textureSize(shaded, 0) - 1;
    for (int k = 0; k < 4; ++k) {
        ivec2 beside = clamp(pixel + ivec2[](ivec2(1, 0), ivec2(-1, 0), ivec2(0, 1), ivec2(0, -1))[k], ivec2(0), last);
        vec4 there = texelFetch(surface_position, beside, 0);
        if (there.w != here.w) return true;
        vec3 step = there.xyz - here.xyz;
        if (here.w > 0.5 && (dot(normal, texelFetch(surface_normal, beside, 0).xyz) < 0.9 || abs(dot(normal, step)) > 0.3 * length(step))) return true;
    }
    return false;
}

float luma(vec3 c) {
    return dot(c, vec3(0.299, 0.587, 0.114));
}

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec3 here = texelFetch(shaded, pixel, 0).rgb;
    color = vec4(here, 1.0);
    if (!meets_another(pixel)) return;
    vec2 texel = 1.0 / vec2(textureSize(shaded, 0)), at = gl_FragCoord.xy * texel;
    float nw = luma(textureLod(shaded, at + vec2(-1, 1) * texel, 0.0).rgb), ne = luma(textureLod(shaded, at + vec2(1, 1) * texel, 0.0).rgb);
    float sw = luma(textureLod(shaded, at + vec2(-1, -1) * texel, 0.0).rgb), se = luma(textureLod(shaded, at + vec2(1, -1) * texel, 0.0).rgb);
    float least = min(luma(here), min(min(nw, ne), min(sw, se))), most = max(luma(here), max(max(nw, ne), max(sw, se)));
    vec2 along = vec2(sw + se - nw - ne, nw + sw - ne - se) * vec2(-1, 1);
    along = clamp(along / (min(abs(along.x), abs(along.y)) + max((nw + ne + sw + se) / 32.0, 1.0 / 128.0)), -8.0, 8.0) * texel;
    vec3 inner = 0.5 * (textureLod(shaded, at - along / 6.0, 0.0).rgb + textureLod(shaded, at + along / 6.0, 0.0).rgb);
    vec3 outer = 0.5 * inner + 0.25 * (textureLod(shaded, at - 0.5 * along, 0.0).rgb + textureLod(shaded, at + 0.5 * along, 0.0).rgb);
    color = vec4(luma(outer) < least || luma(outer) > most ? inner : outer, 1.0);
}
