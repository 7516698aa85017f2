"""The casters' silhouette as the light sees it, drawn into a map: in which of its texels a caster ends."""

from collections.abc import Mapping, Sequence

import numpy as np

from shadowbench.geometry.topology import casters_of
from shadowbench.gl.program import Sampling, State, Texture, Value
from shadowbench.gl.targets import Kind
from shadowbench.techniques.base import Frame, Stage, TechniqueParams

_CORNERS = 6  # vertices of an edge in silhouette.vert
_STATE = State(depth_test="<=", depth_clamp=True)


class Silhouettes:
    """Draws silhouette edges that no caster hides from the light, with the linear depth of the nearest in each texel.

    The edges are found by compiled code: those between a triangle that faces the light and one that does not, and those
    of one triangle only. size, kind: of the map whose linear depths decide what is hidden.
    """

    def __init__(self, stage: Stage, params: TechniqueParams, size: int, kind: Kind) -> None:
        from shadowbench.geometry.facing import wall_weights  # Numba takes 0.4 s to import

        casters = casters_of(stage.scene)
        self._edges, self._closed = casters.all.edges, len(casters.closed.edges)
        self._exact = stage.scene.geometry.vertices
        self._vertices = self._exact.astype(np.float32)
        self._weights = wall_weights
        self._program = stage.program(
            "hybrid/silhouette.vert", "hybrid/silhouette.frag", params=params, includes={"map": kind}
        )
        self._upload = stage.stream(self._program, {"a": 3, "b": 3})
        self._map = stage.depth_target(size, "d32f", kind)

    def draw(
        self, frame: Frame, depths: tuple[Texture, Sampling], draws: Sequence[Mapping[str, Value]]
    ) -> tuple[Texture, Sampling]:
        """Depth of the nearest edge in each texel, 1 for none. depths: of the map; draws: uniforms of each layer."""
        light = np.array(frame.light_uniform)
        drawn = self._edges[self._weights(self._exact, self._edges, light, 0, self._closed) != 0]
        ends = np.concatenate([self._vertices[drawn[:, 1]], self._vertices[drawn[:, 2]]], axis=1)
        edges = self._upload(np.repeat(ends, _CORNERS, axis=0))
        self._map.target.clear(depth=1.0)
        for target, uniforms in zip(self._map.layer_targets or (self._map.target,), draws, strict=True):
            self._program.set(**uniforms)
            edges.draw(target, {"map_contents": depths}, _STATE)
        return self._map.texture, Sampling()
