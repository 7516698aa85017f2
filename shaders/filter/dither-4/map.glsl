// Thousandths of the map's side, as published.
float width_in_texels() { return filter_width * map_size / 1000.0; }
