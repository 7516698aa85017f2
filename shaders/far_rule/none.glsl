// Receivers beyond the map's far plane are in shadow, as where nothing is done about them. Explicit, as fixed-point formats
// clamp the compared depth and float formats do not.
const float visibility_beyond = 0.0;

bool beyond(ShadowCoord p) { return from_near(p.depth) - 1.0 - p.bias > 0.0; }
