// Width of penumbrae by similar triangles, in local lengths across the light's rays.
uniform float light_radius;    // the tangent of a sun's angular radius, or the radius of another light
uniform float nearest_caster;  // largest coordinate of a caster towards a sun, or least distance from another light

// Radius of the light as projected onto the receiver through a point `gap` along the light's axis in front of it.
float penumbra_radius(ShadowCoord p, float gap) {
    return light.w == 0.0 ? light_radius * gap : light_radius * gap / max(p.axis_distance - gap, light_radius);
}

// The same for the caster nearest to the light: no penumbra is wider.
float widest_penumbra(ShadowCoord p) {
    float gap = light.w == 0.0 ? nearest_caster - dot(light.xyz, p.position)
                               : distance(light.xyz, p.position) / nearest_caster - 1.0;
    return light_radius * max(gap, 0.0);
}
