// Width of penumbrae by similar triangles, in local lengths across the light's rays.
uniform float light_radius;    // the tangent of a sun's angular radius, or the radius of another light
uniform float nearest_caster;  // largest coordinate of a caster towards a sun, or least distance from another light

// Distance along the light's rays from the receiver to the caster that is nearest to the light.
float largest_gap(ShadowCoord p) {
    return max(light.w == 0.0 ? nearest_caster - dot(light.xyz, p.position) : p.axis_distance - nearest_caster, 0.0);
}

// Radius of the part of the light that the receiver sees past a caster's edge, projected onto the receiver.
float penumbra_radius(ShadowCoord p, float gap) {
    return light.w == 0.0 ? light_radius * gap : light_radius * gap / max(p.axis_distance - gap, light_radius);
}
