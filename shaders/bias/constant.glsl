uniform float bias_units;
uniform float bias_world;

ShadowCoord bias(ShadowCoord p) {
    p.bias += bias_world > 0.0 ? bias_world * p.depth_per_length : bias_units;
    return p;
}
