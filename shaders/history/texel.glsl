// How near a point is to the centre of its texel: 1 there, 0 at the texel's border.
float texel_confidence(ShadowCoord p) {
    vec2 away = abs(to_centre(p, vec2(0.0)));
    return 1.0 - 2.0 * max(away.x, away.y);
}
