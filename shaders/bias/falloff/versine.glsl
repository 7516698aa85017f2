vec3 bias_offset(ShadowCoord p, float reach) { return p.receiver.normal * reach * (1.0 - p.receiver.cosine); }
