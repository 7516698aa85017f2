// Facing of triangles towards the light, bit-identical in every shader and for every edge: if a triangle's cap and one
// of its edges disagreed, the volume would not be closed.
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

// 1 if a, b, c are counter-clockwise seen from the light, else −1. The determinant is evaluated in the order of the ids,
// and with `precise`, so that rounding does not depend on which corner comes first.
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

// Weight of a triangle's cap: in closed parts 1 if it faces the light, else 0; in open parts ±1 by its facing.
uniform bool count_both_facings;
float cap_weight(float side) { return count_both_facings ? side : max(side, 0.0); }

// Weight of the wall of edge a → b: the sum over the edge's two triangles of ±1, the direction of the edge in the
// triangle when wound counter-clockwise towards the light. That is the facing of a, b, third corner, whatever the
// triangle's own winding. In a closed part only the facing one of two triangles counts, which halves the sum.
float wall_weight(Corner c, Corner a, Corner b, Corner d) {
    float sum = facing(a, b, c) + (d.id == a.id ? 0.0 : facing(a, b, d));
    return count_both_facings ? sum : 0.5 * sum;
}
