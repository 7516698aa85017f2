// A texel shadows if its caster is in front of the receiver both at the texel's centre, on the receiver's plane, and at
// the receiver's point, on the caster's plane. On a surface z of Hessian H the two are -aᵀHa/2 and aᵀHa/2, a being the way
// to the centre: one of them is never in front.
#define TEXEL_SURE

// By how much more than the slack the caster is in front of the receiver's point.
float in_front(ShadowCoord p, Texel t) {
    vec2 reach = p.slack * abs(t.offset);  // in an order by which texels of a row or a column share sums
    return depth_sign * p.depth - p.bias - reach.x - reach.y - depth_sign * t.depth;
}

// Without the caster's plane: 1 lit, 0 in shadow, and `unsure` where that plane decides.
float texel_sure(ShadowCoord p, Texel t) {
    float front = in_front(p, t), centre = depth_sign * receiver_change(p, t);
    if (front + centre <= 0.0 && front <= p.longest && from_near(t.depth) > 0.0) return 1.0;
    return front + min(centre, 0.0) <= p.longest ? unsure : 0.0;
}

bool texel_lit(ShadowCoord p, Texel t) {
    float front = in_front(p, t), slack = dot(vec2(p.slack), abs(t.offset)) + p.bias;
    float centre = min(depth_sign * receiver_change(p, t), 1.0 - from_near(p.depth));  // behind no empty texel
    float point = depth_sign * caster_change(p, t);
    // What is farther in front of the point shadows it, unless both planes are about there: that of a steep facet at a
    // silhouette is extended no farther. And so does what is in front of the near plane, and stored there.
    bool near = front <= p.longest || front + max(centre, point) <= max(p.longest - slack, 0.0);
    return front + min(centre, point) <= 0.0 && near && from_near(t.depth) > 0.0;
}
