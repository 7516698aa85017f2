// Passes a corner of a cut-out triangle on, if the program draws them.
#ifdef CUTOUTS
in vec3 cutout_place;  // texture coordinates and vertex alpha
in ivec2 cutout_face;  // numbers of the cut-out and of the triangle
out Cutout { vec3 place; flat ivec2 face; } cutout;

void pass_cutout() {
    cutout.place = cutout_place;
    cutout.face = cutout_face;
}
#else
void pass_cutout() {}
#endif
