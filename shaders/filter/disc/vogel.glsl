// The i-th of `count` points, each with the same share of the disc's area: the golden angle from one to the next.
vec2 disc_point(int i, int count) {
    return sqrt((float(i) + 0.5) / float(count)) * rotation(golden_angle * float(i))[0];
}
