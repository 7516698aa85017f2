// All texels with the receiver's depth.
#define HARDWARE_DEPTH(p, offset) (p.depth - depth_sign * p.bias)

bool texel_lit(ShadowCoord p, Texel t) {
    float depth = stored_range(p.depth, p.bias + depth_step);
    return depth_sign * (depth - t.depth) <= p.bias;
}
