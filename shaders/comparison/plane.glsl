// Each texel with the receiver's plane there: at its centre, or in a cube map, whose planes are no linear functions of
// a face's coordinates, in the direction that is looked up.
#define BLOCKS(p, offset, linear) (!(linear >= plane_depth(p, offset)))
#if CUBE == 1
#define HARDWARE_DEPTH(p, offset) plane_depth(p, offset)

bool texel_lit(ShadowCoord p, Texel t) { return plane_depth(p, t.offset) <= t.depth; }
#else
bool texel_lit(ShadowCoord p, Texel t) {
    // Clamped as stored depths are: beyond the far plane the receiver's plane must not be behind an empty texel, nor
    // before the near plane in front of casters clamped to it.
    float depth = stored_range(p.depth + receiver_change(p, t), p.bias + depth_step);
    return depth_sign * (depth - t.depth) <= p.bias;
}
#endif
