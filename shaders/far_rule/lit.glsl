// Receivers beyond the map's far plane are lit.
const float visibility_beyond = 1.0;

bool beyond(ShadowCoord p) { return from_near(p.depth) > 1.0; }
