uniform float history_alpha;

float share_of_frame(ivec2 pixel) { return history_alpha; }
