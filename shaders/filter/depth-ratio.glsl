// (z - b)/b of a receiver's depth z and the mean depth b of its blockers, measured from the near plane for a sun, as engines
// do, and from any other light. Casters in front of a near plane are taken to be just behind it.
float depth_ratio(ShadowCoord p, float gap) {
    float z = light.w == 0.0 ? p.linear / p.linear_per_length : p.axis_distance;
    return gap / max(z - gap, 1e-4 / p.linear_per_length);
}
