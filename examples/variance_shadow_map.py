"""A variance shadow map as a filter of shadow-map, cascades and cube-map.

shadowbench run spot-lamp -t "shadow-map:filter=variance" -t shadow-map --plugin examples/variance_shadow_map.py
"""

from shadowbench.maps.filters import Contents, Filterable
from shadowbench.plugin.params import param

SHADER = """
uniform float filter_bleed;
uniform float filter_min_variance;

// What the map stores for a caster at this depth: the first two moments.
vec4 filter_contents(float depth) {
    float z = clamp(depth, 0.0, 1.0);
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
    return vec4(z, z * z + min(0.25 * dot(slope, slope), 0.01), 0.0, 0.0);
}

// Chebyshev's upper bound on the share of depths of at least z, in a distribution with these moments.
float chebyshev_upper_bound(vec2 moments, float z) {
    float variance = max(moments.y - moments.x * moments.x, filter_min_variance);
    float behind = z - moments.x;
    return behind <= 0.0 ? 1.0 : variance / (variance + behind * behind);
}

float filter_visibility(ShadowCoord p) {
    float lit = chebyshev_upper_bound(contents_at(p, vec2(0.0)).xy, clamp(p.linear, 0.0, 1.0));
    return clamp((lit - filter_bleed) / (1.0 - filter_bleed), 0.0, 1.0);
}
"""


class Variance(Filterable):
    """Two blurred moments of depth, and Chebyshev's bound on the lit share (Donnelly and Lauritzen 2006)."""

    name = "variance"
    shader = SHADER
    bleed: float = param(0.2, "share of the bound that is cut off against light bleeding", ge=0, lt=1)
    min_variance: float = param(1e-6, "lower limit of the variance, in squared depth", ge=0, le=1)

    @property
    def contents(self):
        return Contents(2, blur=self.blur, kernel=self.kernel, mips=self.mips)
