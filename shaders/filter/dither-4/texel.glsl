float width_in_texels() { return filter_width; }
