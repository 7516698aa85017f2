// Scherzer, Jeschke and Wimmer 2007.
uniform sampler2D map_confidence;
uniform float history_power;

float share_of_frame(ivec2 pixel) { return pow(texelFetch(map_confidence, pixel, 0).r, history_power); }
