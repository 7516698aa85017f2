// Set for every program.
uniform float metre;     // one metre as a local length
uniform float subpixel;  // step of the rasteriser's grid, in pixels of what is drawn, so in texels of a map
