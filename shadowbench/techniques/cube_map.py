"""Shadow mapping of a point light with a cube map of distances."""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.convex import SceneHull
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.program import Value
from shadowbench.gl.targets import FACES, DepthFormat
from shadowbench.maps.biases import Bias, Texel
from shadowbench.maps.caster_map import MAP_GRID, MAP_SOFT_GRID, FilteredMap, MapInputs, MapLayout
from shadowbench.maps.filters import Filter, Hardware
from shadowbench.maps.updates import Always, LastDraw, Update
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import View
from shadowbench.scenes.vectors import Floats
from shadowbench.techniques.shadow_map import ShadowMap

_MARGIN = 1.001  # so that the farthest caster is stored nearer than an empty texel
_NEAREST = 2.0**-24  # near plane as a share of far: closer to the light than float32 positions can resolve
_AXES = np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
# (6, 4, 3) normals of the planes between a face's pyramid and its neighbours, through the light.
_SIDES = np.array([[axis + side for side in np.vstack([np.eye(3), -np.eye(3)]) if side @ axis == 0] for axis in _AXES])


class CubeMap(Technique):
    """Six square maps around a point light that store the distance to it (after Gerasimov, GPU Gems 2004).

    The faces are aligned with the world's axes, so that a phase does not shift them. A spot is drawn as a point light
    and leaves most of the cube unused, as does a light far outside the scene. Fails where a texel, which grows with the
    distance, covers more than a pixel (stairs), behind casters thinner than the bias, which grows towards grazing
    light (leaks), and in dots along concave edges, where a texel stores the depth of the other surface. The published
    constant bias leaves acne under a low light, most with pcf-20, and leaks at contacts.
    """

    name = "cube-map"
    lights = frozenset({"spot", "point"})
    catalogue = Entry(
        picture_scene="lamp-by-wall",
        grid=MAP_GRID,
        soft_grid=MAP_SOFT_GRID,
        builds_on=(ShadowMap,),
    )
    presets = {"course": "bias=constant(world=0.05),filter=pcf-20"}

    class Params(TechniqueParams):
        size: int = param(1024, "texels along a side of a face", ge=1, le=65536)
        depth: DepthFormat = param("d32f", "depth format")
        layers: Literal["geometry", "passes"] = param(
            "passes", "one draw for all faces by geometry shader, or six draws"
        )
        bias: Bias = param(Texel(limit=64), "bias against self-shadowing")
        filter: Filter = param(Hardware(), "filter of the depth comparisons")
        cull: bool = param(True, "skips casters outside a face's frustum; only with layers=passes")
        update: Update = param(Always(), "when the map is redrawn")

        @property
        def layout(self) -> MapLayout:
            """The layout of the map."""
            cull, update = self.cull and self.layers == "passes", self.update
            return MapLayout(self.size, self.depth, "cube", FACES, False, cull, wrap="edge", update=update)

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        if view.light.kind == "directional":
            return "a directional light has no position to look around from"
        return params.layout.unsupported(device, params.bias, params.filter)

    def build(self, stage: Stage) -> None:
        self.build_map(stage)
        self.resolve = self.map.resolve_pass("cube-map/resolve.frag")

    def build_map(self, stage: Stage) -> None:
        """What `draw_map` needs."""
        params = self.params
        self.stage, self.hull = stage, SceneHull(stage.scene)
        geometry = "cube-map/faces.geom" if params.layers == "geometry" else None
        vertex = f"cube-map/{params.layers}.vert"
        self.map = FilteredMap(stage, params, params.layout, self.hull, vertex=vertex, geometry=geometry)
        self.last = LastDraw[float](stage, params.update)

    def draw(self, frame: Frame) -> moderngl.Texture:
        inputs = self.draw_map(frame)
        with frame.timed("resolve", changes="view"):
            return self.map.look_up(self.resolve, self.last.looked_up(frame), inputs)

    def draw_map(self, frame: Frame) -> MapInputs:
        """Draw the faces; the textures and uniforms of shadow_map.glsl."""
        with frame.timed("depth", changes="light"):
            reach = np.linalg.norm(self.hull.points - frame.light.position, axis=1)
            far = float(reach.max()) * _MARGIN
            redraws = self.last.redraws(frame, lambda: (far, far))
            self.far = self.last.window
            if redraws:
                self._draw_faces(frame)
        self.map.prepare(frame, "light", redraws)
        return self.map.inputs(self.last.looked_up(frame).light, {"map_far": self.far})

    def _draw_faces(self, frame: Frame) -> None:
        self.map.program.set(light_position=frame.light.position, map_far=self.far, near=self.far * _NEAREST)
        planes = [np.column_stack([sides, -sides @ frame.light.position]) for sides in _SIDES]
        faces: list[tuple[dict[str, Value], list[Floats]]]  # uniforms of each draw, and the region of its casters
        faces = [({"face": face}, [pyramid]) for face, pyramid in enumerate(planes)]
        self.map.draw_layers(frame, [({}, [])] if self.params.layers == "geometry" else faces)

    def confidence(self) -> moderngl.Texture:
        return self.map.confidence()

    def map_image(self) -> NDArray[np.float32]:
        """The faces side by side, (size, 6·size): +X, −X, +Y, −Y, +Z, −Z."""
        return np.hstack(list(self.map.texture.read()))  # row 0 is the top of a cube's faces, the bottom of other maps

    def facts(self) -> dict[str, float]:
        far = self.far / self.stage.placement.scale
        facts = {"texel_m": 2 * far / self.params.size, "depth_range_m": far}
        bias = self.params.bias.effect.depth * far
        return facts | self.map.facts(self.stage.size.pixels) | ({"bias_m": bias} if bias else {})
