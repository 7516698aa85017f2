// One direction of a separable box blur of TAPS texels, an odd number.
uniform sampler2D source;
uniform vec2 direction;
out vec4 blurred;

void main() {
    vec4 sum = vec4(0.0);
    for (int i = -(TAPS / 2); i <= TAPS / 2; ++i)
        sum += textureLod(source, (gl_FragCoord.xy + float(i) * direction) / vec2(textureSize(source, 0)), 0.0);
    blurred = sum / float(TAPS);
}
