// A texel shadows if its caster is in front of the receiver both at the texel's centre, on the receiver's plane, and at
// the receiver's point, on the caster's plane. On a surface z of Hessian H the two are -aᵀHa/2 and aᵀHa/2, a being the way
// to the centre: one of them is never in front.
#include "units.glsl"

bool texel_lit(ShadowCoord p, Texel t) {
    float slack = p.bias + p.bias_per_texel * length(t.offset);
    float depth = stored_range(p.depth, slack + depth_step);
    float behind = depth_sign * (depth - t.depth);
    float at_centre = depth_sign * (stored_range(receiver_at_centre(p, t), slack + depth_step) - t.depth);
    float at_point = depth_sign * (depth - caster_at_point(p, t)) - 0.5 * subpixel * change_per_texel(t);
    // Planes that differ are not extended without end, as that of a steep facet at a silhouette.
    return min(at_centre, at_point) <= slack && behind <= p.most + slack || max(at_centre, at_point) <= slack;
}
