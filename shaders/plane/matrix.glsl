vec3 to_texels(ShadowCoord p, vec4 v) { return (world_to_map[p.layer] * v).xyw * vec3(map_size, map_size, 1.0); }
