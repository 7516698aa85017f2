float lightened(ShadowCoord p, float gap, float visibility) { return visibility; }
