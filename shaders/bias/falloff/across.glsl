vec3 bias_offset(ShadowCoord p, float reach) {
    vec3 across = p.receiver.normal - p.receiver.to_light * p.receiver.cosine;
    return across * reach * (1.0 - p.receiver.cosine);
}
