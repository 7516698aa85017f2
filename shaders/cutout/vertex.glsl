// Passes a corner of a cut-out triangle on, if the program draws them.
#ifdef CUTOUTS
in vec2 cutout_place;  // in sub-texels
in ivec2 cutout_face;  // numbers of the cut-out and of the triangle
out Cutout { vec2 place; flat ivec2 face; } cutout;

void pass_cutout() {
    cutout.place = cutout_place;
    cutout.face = cutout_face;
}
#else
void pass_cutout() {}
#endif
