"""A map technique as a plug-in: a depth map of its own contents, with the fits that shadow-map has.

    shadowbench run spot-lamp -t variance-shadow-map -t shadow-map --plugin examples/variance_shadow_map.py

`map.glsl` finds a receiver's place in the map (`map_point`) from what `map_uniforms` sets of the light view. It needs
LAYERS and REVERSED beside the SIZE that `params` gives; `receiver.glsl`, which it includes, brings the receiver itself.
"""

from typing import Annotated

from shadowbench.geometry.hull import CasterHull
from shadowbench.gl.gbuffer import download
from shadowbench.gl.program import Sampling, State
from shadowbench.techniques.base import Technique, TechniqueParams, param
from shadowbench.techniques.fits import Fit, Sight, Visible
from shadowbench.techniques.maps import map_uniforms
from shadowbench.techniques.params import one_of
from shadowbench.techniques.reduction import VisibleBounds

# The first two moments of depth, linear along the light's axis for a spot too. gl_FragCoord.w is 1/w, 1 for a sun.
MOMENTS = """
uniform float perspective;
uniform vec2 planes;
out vec2 moments;
void main() {
    float d = perspective > 0.5 ? (1.0 / gl_FragCoord.w - planes.x) / (planes.y - planes.x) : gl_FragCoord.z;
    vec2 slope = vec2(dFdx(d), dFdy(d));
    d = clamp(d, 0.0, 1.0);
    moments = vec2(d, d * d + min(0.25 * dot(slope, slope), 0.01));
}
"""

BLUR = """
uniform sampler2D source;
uniform vec2 direction;
out vec2 moments;
void main() {
    vec2 sum = vec2(0.0);
    for (int i = -(BLUR / 2); i <= BLUR / 2; ++i)
        sum += textureLod(source, (gl_FragCoord.xy + float(i) * direction) / float(SIZE), 0.0).xy;
    moments = sum / float(BLUR);
}
"""

RESOLVE = """
#include "map.glsl"
uniform sampler2D map_moments;
uniform float perspective;
uniform vec2 planes;
uniform float min_variance;
uniform float bleed;
out float visibility;
void main() {
    Receiver r = receiver_at(ivec2(gl_FragCoord.xy));
    MapPoint p = map_point(r.position, 0);
    visibility = 1.0;
    if (!r.facing || p.axis_distance <= 0.0) return;
    float d = perspective > 0.5 ? (p.axis_distance - planes.x) / (planes.y - planes.x) : p.depth;
    if (d > 1.0) return;
    vec2 m = textureLod(map_moments, p.uv, 0.0).xy;
    if (d <= m.x) return;
    float variance = max(m.y - m.x * m.x, min_variance);
    float behind = d - m.x;
    visibility = clamp((variance / (variance + behind * behind) - bleed) / (1.0 - bleed), 0.0, 1.0);
}
"""


class VarianceShadowMap(Technique):
    """Two moments of depth, blurred, and Chebyshev's bound on the share that is lit (Donnelly and Lauritzen 2006).

    Fails where two casters lie over each other (light bleeds), and at contact.
    """

    name = "variance-shadow-map"
    lights = frozenset({"directional", "spot"})
    phased = True
    presets = {"sharp": "blur=1,bleed=0.5"}

    class Params(TechniqueParams):
        """Parameters of variance-shadow-map."""

        fit: Annotated[Fit, one_of(Fit)] = param(Visible(), "which part of the scene the map shows")
        size: int = param(1024, "texels along a side of the map", ge=1, le=16384)
        blur: int = param(3, "taps along a side of the box blur, odd", ge=1, le=31)
        bleed: float = param(0.2, "share of the bound that is cut off against light bleeding", ge=0, lt=1)
        min_variance: float = param(1e-6, "least variance, in squared depth", ge=0, le=1)

    def build(self, stage):
        params = self.params
        self.stage, size = stage, (params.size, params.size)
        self.hull, self.bounds = CasterHull(stage.scene), VisibleBounds(stage)
        self.depth = stage.depth_target(params.size, "d32f")
        self.moments, self.blurred = stage.texture(size, 2), stage.texture(size, 2)
        self.map_target = stage.target(self.moments, depth=self.depth.texture)
        self.blur_targets = [stage.target(self.blurred), stage.target(self.moments)]
        self.depth_program = stage.program("casters.vert", MOMENTS)
        self.blur_program = stage.program("fullscreen.vert", BLUR, params=params)
        self.resolve_program = stage.program(
            "fullscreen.vert", RESOLVE, params=params, defines={"LAYERS": 1, "REVERSED": 0}
        )
        self.casters = stage.casters(self.depth_program)
        self.blur = stage.fullscreen(self.blur_program)
        self.fullscreen = stage.fullscreen(self.resolve_program)
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame):
        params, moves = self.params, self.params.fit.moves_with
        with frame.timed("fit", changes=moves):
            sight = Sight(frame.view, self.stage.placement, self.hull, lambda space: self.bounds(frame, space))
            self.seen = params.fit.light_view(sight, params.size, params.blur / 2 + 1, frame.phase.shift)
            space = {"perspective": float(self.seen.space.perspective), "planes": (self.seen.near, self.seen.far)}
        with frame.timed("depth", changes=moves):
            self.depth_program.set(world_to_clip=self.seen.to_clip(), **space)
            self.map_target.clear(1.0, 1.0, 1.0, 1.0, depth=1.0)
            self.casters.draw(self.map_target, state=State(depth_test="<=", depth_clamp=params.fit.clamps))
        with frame.timed("blur", changes=moves):
            if params.blur > 1:
                steps = ((self.moments, (1.0, 0.0)), (self.blurred, (0.0, 1.0)))
                for target, (source, direction) in zip(self.blur_targets, steps, strict=True):
                    self.blur_program.set(direction=direction)
                    self.blur.draw(target, {"source": (source, Sampling(wrap="edge"))})
        with frame.timed("resolve", changes="view"):
            self.resolve_program.set(light=frame.light_uniform, **space, **map_uniforms([self.seen]))
            moments = {"map_moments": (self.moments, Sampling(linear=True, wrap="border", border=1.0))}
            self.fullscreen.draw(self.target, frame.surface.inputs | moments)
        return self.visibility

    def map_image(self):
        return download(self.moments)[..., 0]

    def facts(self):
        return {"texel_m": max(self.seen.texel) / self.stage.placement.scale}
