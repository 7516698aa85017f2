"""An exponential shadow map in layers of depth, as a filter with contents of its own.

shadowbench run stairs -t "shadow-map:filter=layered-esm" -t shadow-map --plugin examples/exponential_shadow_map.py
"""

from shadowbench.maps.filters import Contents, Filterable
from shadowbench.plugin.params import param

SHADER = """
uniform float filter_c;
const float overlap = 0.125;  // of neighbouring layers, so that a blurred plane is lit across their border too

// Depth in each layer: from 0 at its front to 1 at its back, clamped for casters in other layers.
vec4 layered(float depth) {
    vec4 front = vec4(0.0, 1.0, 2.0, 3.0) - overlap;
    return clamp((float(FILTER_LAYERS) * clamp(depth, 0.0, 1.0) - front) / (1.0 + 2.0 * overlap), 0.0, 1.0);
}

// What the map stores: e^(c (z - 1)) in each layer, which does not overflow.
vec4 filter_contents(float depth) { return exp(filter_c * (layered(depth) - 1.0)); }

float filter_visibility(ShadowCoord p) {
    int layer = clamp(int(float(FILTER_LAYERS) * p.linear), 0, FILTER_LAYERS - 1);
    return min(contents_at(p, vec2(0.0))[layer] * exp(filter_c * (1.0 - layered(p.linear)[layer])), 1.0);
}
"""


class LayeredESM(Filterable):
    """Exponential shadow maps (Annen et al. 2008) of layers of the depth range, each with the full exponent.

    As sharp as a map with 0.8 · layers · c, which 32 bits do not hold beyond 87, so that it leaks less at contacts.
    """

    name = "layered-esm"
    shader = SHADER
    layers: int = param(2, "equal parts of the depth range", ge=1, le=4)
    c: float = param(80.0, "sharpness in each layer; e^c overflows beyond 87", gt=0, le=87)

    @property
    def contents(self):
        return Contents(self.layers, blur=self.blur, kernel=self.kernel, mips=self.mips)
