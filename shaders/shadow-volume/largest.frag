// The largest of REACH × REACH texels.
uniform sampler2D values;
out float largest;

void main() {
    ivec2 first = ivec2(gl_FragCoord.xy) * REACH, size = textureSize(values, 0);
    largest = 0.0;
    for (int y = first.y; y < min(first.y + REACH, size.y); y++)
        for (int x = first.x; x < min(first.x + REACH, size.x); x++)
            largest = max(largest, texelFetch(values, ivec2(x, y), 0).r);
}
