// Cut-outs, if the program draws them (CUTOUTS): where a surface is opaque says the nearest bit of a bitmap, as in
// `truths/packets.py`. Vertex shaders call pass_cutout(), geometry shaders pass_cutout(corner) and fragment shaders cut_out().
// What traces rays defines RAYS, and asks is_opaque.
#ifdef CUTOUTS
uniform usampler2D cutout_words;   // of all cut-outs in turn, row by row, 32 bits each, CUTOUT_ROW side by side
uniform isampler2D cutout_table;   // of each: first word, width, height, wraps of u · 3 + v

// A place as a sub-texel's whole numbers. In floats, as drivers on a CPU divide integers one by one.
vec2 wrapped(vec2 place, ivec4 bitmap) {
    vec2 size = vec2(bitmap.yz), whole = floor(place);
    ivec2 wraps = ivec2(bitmap.w / 3, bitmap.w % 3);
    vec2 period = size * mix(vec2(1.0), vec2(2.0), equal(wraps, ivec2(1)));
    vec2 inside = whole - period * floor((whole + 0.5) / period);
    inside = min(inside, 2.0 * size - 1.0 - inside);  // mirrored; a repeated one is below that
    inside = mix(inside, whole, equal(wraps, ivec2(2)));
    return clamp(inside, vec2(0.0), size - 1.0);
}

ivec4 bitmap_of(int cutout) { return texelFetch(cutout_table, ivec2(cutout % TRIANGLE_ROW, cutout / TRIANGLE_ROW), 0); }

bool is_set(ivec4 bitmap, vec2 place) {
    ivec2 at = ivec2(wrapped(place, bitmap));
    int word = bitmap.x + at.y * ((bitmap.y + 31) >> 5) + (at.x >> 5);
    uint bits = texelFetch(cutout_words, ivec2(word % CUTOUT_ROW, word / CUTOUT_ROW), 0).r;
    return (bits >> uint(at.x & 31) & 1u) != 0u;
}

// place: in sub-texels.
bool is_opaque(int cutout, vec2 place) { return is_set(bitmap_of(cutout), place); }

#ifdef VERT
in vec2 cutout_place;  // in sub-texels
in ivec2 cutout_face;  // numbers of the cut-out and of the triangle
out Cutout { vec2 place; flat ivec2 face; } cutout;

void pass_cutout() {
    cutout.place = cutout_place;
    cutout.face = cutout_face;
}
#elif defined(GEOM)
in Cutout { vec2 place; flat ivec2 face; } cutouts[];
out Cutout { vec2 place; flat ivec2 face; } cutout;

void pass_cutout(int corner) {
    cutout.place = cutouts[corner].place;
    cutout.face = cutouts[corner].face;
}
#elif !defined(RAYS)
in Cutout { vec2 place; flat ivec2 face; } cutout;

void cut_out() { if (!is_opaque(cutout.face.x, cutout.place)) discard; }
int triangle_here() { return cutout.face.y; }
#endif
#elif defined(VERT)
void pass_cutout() {}
#elif defined(GEOM)
void pass_cutout(int corner) {}
#else
void cut_out() {}
int triangle_here() { return gl_PrimitiveID; }
#endif
