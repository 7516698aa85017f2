// Which way triangles are turned, so that every shader and every edge finds the same for the same triangle: a single
// triangle that its cap takes for facing and one of its edges for turned away leaves the volume open.
uniform vec4 light;  // w = 0: unit vector towards it; w = 1: its position

struct Corner {
    vec3 position;
    int id;
};

void order(inout Corner a, inout Corner b, inout float parity) {
    if (b.id < a.id) {
        Corner lower = b;
        b = a;
        a = lower;
        parity = -parity;
    }
}

// 1 where a, b, c run counter-clockwise as the light sees them, else −1. Rounding cannot depend on which corner comes
// first, because the determinant is taken in the order of the ids, and `precise` forbids fusing it differently.
float facing(Corner a, Corner b, Corner c) {
    float parity = 1.0;
    order(a, b, parity);
    order(b, c, parity);
    order(a, b, parity);
    precise vec3 u = b.position - a.position;
    precise vec3 v = c.position - a.position;
    precise vec3 l = light.xyz - light.w * a.position;
    precise float x = (u.y * v.z - u.z * v.y) * l.x;
    precise float y = (u.z * v.x - u.x * v.z) * l.y;
    precise float z = (u.x * v.y - u.y * v.x) * l.z;
    precise float volume = x + y + z;
    return volume > 0.0 ? parity : -parity;
}

// How often a triangle's cap counts: facing ones once in a closed part, all of them, turned to the light, in others.
uniform bool count_both_facings;
float cap_weight(float side) { return count_both_facings ? side : max(side, 0.0); }

// How often the wall of edge a → b counts: the sum over its two triangles of ±1, by the direction in which the triangle,
// turned to the light, runs along the edge. That is its facing in the order a, b, third corner, however it is wound.
// In a closed part only the facing one of two opposed triangles counts, which halves the sum.
float wall_weight(Corner c, Corner a, Corner b, Corner d) {
    float sum = facing(a, b, c) + (d.id == a.id ? 0.0 : facing(a, b, d));
    return count_both_facings ? sum : 0.5 * sum;
}
