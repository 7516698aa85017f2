// The chosen bias. A bias file defines what it needs of
//   BIAS_HAS_MOVE      vec3 bias_move(Receiver r, MapPoint p): how far the receiver moves before it is projected
//   BIAS_HAS_DEPTH     float bias_depth(Receiver r, MapPoint p): what is subtracted from its depth
//   BIAS_HAS_GRADIENT  vec2 bias_gradient(Receiver r, MapPoint p): its depth's gradient over uv
// and the rest is nothing.

// Of the angle between the surface and what the map's depth grows along. For a directional light and for a cube, whose
// depth is the distance, that is θ, the angle between N and L; for a spot it differs from θ off the axis, where even a
// surface that faces the light changes its depth in the map.
float sin_slope(Receiver r, MapPoint p) {
    float along = dot(r.normal, p.axis);
    return sqrt(max(1.0 - along * along, 0.0));
}

// Depth along the axis that the surface gains for each length across the map: on the plane N·P = c seen in direction
// d (d·axis = 1) the depth is c/(N·d), and its gradient is |N across the axis| · depth/(N·d).
float tan_slope(Receiver r, MapPoint p) {
    return sin_slope(r, p) * p.axis_distance / (r.distance * max(r.cosine, 1e-6));
}

#include "bias/whole.glsl"
