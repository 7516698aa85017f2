"""A variance shadow map as a plug-in, with the fits of shadow-map.

    shadowbench run spot-lamp -t variance-shadow-map -t shadow-map --plugin examples/variance_shadow_map.py

`FittedView` fits the light view, `CasterMap` renders the moments with the first shader, and `shadow_coord` of
`map.glsl` computes a receiver's shadow coordinates from the light view's `map_uniforms`.
"""

from shadowbench.gl.gbuffer import download
from shadowbench.techniques.base import Technique, param
from shadowbench.techniques.maps import BoxBlur, CasterMap, FittedParams, FittedView, far_distance, map_uniforms
from shadowbench.techniques.resolve import ResolvePass

STORE = """
#include "linear_depth.glsl"
out vec2 moments;

void main() {
    float d = linear_depth(gl_FragCoord.z, 1.0 / gl_FragCoord.w);
    vec2 slope = vec2(dFdx(d), dFdy(d));
    moments = vec2(d, d * d + min(0.25 * dot(slope, slope), 0.01));
}
"""

RESOLVE = """
#include "map.glsl"
#include "linear_depth.glsl"
uniform sampler2D map_stored;
uniform float min_variance;
uniform float bleed;
out float visibility;

// Chebyshev's upper bound on the share of depths of at least d, in a distribution with these moments.
float chebyshev_upper_bound(vec2 moments, float d) {
    float variance = max(moments.y - moments.x * moments.x, min_variance);
    float behind = d - moments.x;
    return behind <= 0.0 ? 1.0 : variance / (variance + behind * behind);
}

void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    ShadowCoord p = shadow_coord(r.position, 0);
    visibility = 1.0;
    if (!r.facing || p.axis_distance <= 0.0 || p.depth > 1.0) return;
    vec2 moments = textureLod(map_stored, p.uv, 0.0).xy;
    float lit = chebyshev_upper_bound(moments, linear_depth(p.depth, p.axis_distance));
    visibility = clamp((lit - bleed) / (1.0 - bleed), 0.0, 1.0);
}
"""


class VarianceShadowMap(Technique):
    """Two blurred moments of depth, and Chebyshev's bound on the lit share (Donnelly and Lauritzen 2006).

    Fails where casters overlap, seen from the light (light bleeding), and at contacts.
    """

    name = "variance-shadow-map"
    lights = frozenset({"directional", "spot"})
    phased = True
    presets = {"sharp": "blur=1,bleed=0.5"}

    class Params(FittedParams):
        """Parameters of variance-shadow-map."""

        blur: int = param(3, "taps along a side of the box blur, odd", ge=1, le=31)
        bleed: float = param(0.2, "share of the bound that is cut off against light bleeding", ge=0, lt=1)
        min_variance: float = param(1e-6, "lower limit of the variance, in squared depth", ge=0, le=1)

    def build(self, stage):
        params = self.params
        self.stage = stage
        self.fitted = FittedView(stage, params.fit, params.size, filter_radius=params.blur / 2)
        self.map = CasterMap(
            stage, stage.program("casters.vert", STORE), params.size, components=2, clamp=params.fit.clamps
        )
        self.blur = BoxBlur(stage, self.map.contents, params.blur)
        self.resolve = ResolvePass(stage, RESOLVE, params)

    def draw(self, frame):
        moves = self.params.fit.invalidated_by
        with frame.timed("fit", changes=moves):
            self.light_view = self.fitted(frame)
        with frame.timed("depth", changes=moves):
            self.map.draw(frame, [self.light_view])
        with frame.timed("blur", changes=moves):
            self.blur()
        with frame.timed("resolve", changes="view"):
            uniforms = map_uniforms([self.light_view]) | {"far_distance": far_distance(self.light_view)}
            return self.resolve(frame, self.map.stored, **uniforms)

    def map_image(self):
        return download(self.map.contents)[..., 0]

    def facts(self):
        return {"texel_m": max(self.light_view.texel) / self.stage.placement.scale}
