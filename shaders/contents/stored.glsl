vec4 contents_at(ShadowCoord p, vec2 offset) { return contents_of_level(p, offset, 0.0); }
