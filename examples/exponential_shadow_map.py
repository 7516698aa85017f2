"""Exponential shadow maps: shadowbench run stairs -t exponential-shadow-map --plugin exponential_shadow_map.py."""

from shadowbench.techniques.base import Technique, param
from shadowbench.techniques.maps import BoxBlur, CasterMap, FittedParams, FittedView, far_distance, map_uniforms
from shadowbench.techniques.resolve import ResolvePass

STORE = """#include "linear_depth.glsl"
uniform float c;
out float stored;
void main() { stored = exp(c * (linear_depth(gl_FragCoord.z, 1.0 / gl_FragCoord.w) - 1.0)); }"""

RESOLVE = """#include "map.glsl"
#include "linear_depth.glsl"
uniform sampler2D map_stored;
uniform float c;
out float visibility;
void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    ShadowCoord p = shadow_coord(r.position, 0);
    float lit = textureLod(map_stored, p.uv, 0.0).r * exp(c * (1.0 - linear_depth(p.depth, p.axis_distance)));
    visibility = r.facing && p.axis_distance > 0.0 && p.depth < 1.0 ? min(lit, 1.0) : 1.0;
}"""


class ExponentialShadowMap(Technique):
    """Blurred e^(c·depth) over the receiver's (Annen et al. 2008). Leaks at contacts, within 1/c of the range."""

    name = "exponential-shadow-map"
    lights = frozenset({"directional", "spot"})
    phased = True

    class Params(FittedParams):
        c: float = param(80.0, "sharpness; e^c overflows float32 beyond 87", gt=0, le=87)
        blur: int = param(3, "taps along a side of the box blur, odd", ge=1, le=31)

    def build(self, stage):
        self.fitted = FittedView(stage, self.params.fit, self.params.size, filter_radius=self.params.blur / 2 + 0.5)
        program = stage.program("casters.vert", STORE, params=self.params)
        self.map = CasterMap(stage, program, self.params.size, components=1, clamp=self.params.fit.clamps)
        self.blur = BoxBlur(stage, self.map.contents, self.params.blur)
        self.resolve = ResolvePass(stage, RESOLVE, self.params)

    def draw(self, frame):
        with frame.timed("map", changes=self.params.fit.invalidated_by):
            self.light_view = self.fitted(frame)
            self.map.draw(frame, [self.light_view])
            self.blur()
        with frame.timed("resolve", changes="view"):
            uniforms = map_uniforms([self.light_view]) | {"far_distance": far_distance(self.light_view)}
            return self.resolve(frame, self.map.stored, **uniforms)
