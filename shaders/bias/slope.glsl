uniform float bias_max;
uniform float bias_min;

ShadowCoord bias(ShadowCoord p) {
    p.bias += max(bias_max * (1.0 - p.receiver.cosine), bias_min);
    return p;
}
