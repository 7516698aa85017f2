// Sine of the angle between the surface's normal and the direction of the map's depth. For a directional light and for a
// cube map, whose depth is the distance, that angle is θ, between N and L. For a spot it differs from θ off the axis,
// where the map's depth varies even over a surface that faces the light.
float sin_slope(ShadowCoord p) {
    float along = dot(p.receiver.normal, p.axis);
    return sqrt(max(1.0 - along * along, 0.0));
}

// Change of the distance along the axis per length across the map: on the plane N·P = c the distance in direction
// d (d·axis = 1) is c/(N·d), and its gradient is |N perpendicular to the axis| · distance/(N·d).
float tan_slope(ShadowCoord p) {
    return sin_slope(p) * p.axis_distance / (p.receiver.distance * max(p.receiver.cosine, 1e-6));
}

// Resolution of the comparison: the larger of the format's step and the rounding error of positions, which dominates over
// a short depth range.
float resolution(ShadowCoord p) { return max(depth_step, position_step * p.depth_per_length); }
