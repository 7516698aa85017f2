// Passes a corner of a cut-out triangle on, if the program draws them.
#ifdef CUTOUTS
in Cutout { vec2 place; flat ivec2 face; } cutouts[];
out Cutout { vec2 place; flat ivec2 face; } cutout;

void pass_cutout(int corner) {
    cutout.place = cutouts[corner].place;
    cutout.face = cutouts[corner].face;
}
#else
void pass_cutout(int corner) {}
#endif
