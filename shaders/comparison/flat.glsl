// All texels are compared with the depth of the receiver.

// 1 unless the receiver is behind the nearest texel.
float compare_nearest(ShadowCoord p, vec2 offset) {
    // Clamped as stored depths are: a receiver before the near plane is not in front of casters clamped to it.
    float depth = stored_range(p.depth, p.bias + depth_step);
    return depth_sign * (depth - nearest_depth(p, offset)) <= p.bias ? 1.0 : 0.0;
}

// The same of the four nearest texels, with bilinear weights.
float compare_linear(ShadowCoord p, vec2 offset) {
    return hardware_comparison(p, offset, p.depth - depth_sign * p.bias);
}
