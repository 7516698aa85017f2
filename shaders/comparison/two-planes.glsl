// A texel shadows if its caster is in front of the receiver both at the texel's centre, on the receiver's plane, and at
// the receiver's point, on the caster's plane. On a surface z of Hessian H the two are -aᵀHa/2 and aᵀHa/2, a being the way
// to the centre: one of them is never in front.
#define TEXEL_SURE

struct AtCentre {
    float slack, most;  // by which the caster may be in front if it does not shadow, and if the other plane says that it does not
    float behind;       // by which the receiver's plane is behind the caster
    bool near;          // what is farther in front of the receiver's point shadows it, unless both planes are about there:
                        // that of a steep facet at a silhouette is extended no farther
};

float clamped_depth(ShadowCoord p) { return stored_range(p.depth, p.bias + depth_step); }

AtCentre at_centre(ShadowCoord p, Texel t) {
    // Casters in front of the near plane are stored at near; a slack larger than the receiver's depth would miss them.
    float slack = min(p.bias + p.slack * (abs(t.offset.x) + abs(t.offset.y)), from_near(clamped_depth(p)) - depth_step);
    float behind = depth_sign * (stored_range(receiver_at_centre(p, t), slack + depth_step) - t.depth);
    bool near = depth_sign * (clamped_depth(p) - t.depth) <= p.longest + slack;
    return AtCentre(slack, max(p.longest, slack), behind, near);
}

// Without the caster's plane: 1 lit, 0 in shadow, and one half where that plane decides.
float texel_sure(ShadowCoord p, Texel t) {
    AtCentre c = at_centre(p, t);
    return c.near && c.behind <= c.slack ? 1.0 : c.near || c.behind <= c.most ? 0.5 : 0.0;
}

bool texel_lit(ShadowCoord p, Texel t) {
    AtCentre c = at_centre(p, t);
    float at_point = depth_sign * (clamped_depth(p) - caster_at_point(p, t));
    return min(c.behind, at_point) <= c.slack && (c.near || max(c.behind, at_point) <= c.most);
}
