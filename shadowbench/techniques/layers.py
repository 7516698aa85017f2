"""Upper bound on the number of caster layers that a light ray crosses, by rasterisation from the light."""

import moderngl
import numpy as np

from shadowbench.geometry.topology import Casters
from shadowbench.gl.program import Sampling, State
from shadowbench.scenes.geometry import bounds_of, used_by
from shadowbench.scenes.model import Floats, Light, perpendicular_basis, unit
from shadowbench.techniques.base import Frame, Stage
from shadowbench.techniques.reduction import MinMaxReduction

_SIZE = (3072, 2048)  # texels; a point light's six tiles have 1024² each. The bound is tighter for smaller texels
_FACES = ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))


class LayerBound:
    """Sums per texel the weights of the triangles at its centre and of the silhouette edges that touch it.

    The largest sum bounds the layers of every ray: from the ray through a texel's centre to any other ray through the
    texel, the number of layers changes only at silhouette edges that touch the texel, at each by at most its weight.
    """

    def __init__(self, stage: Stage, casters: Casters) -> None:
        geometry = stage.scene.geometry
        self._corners = bounds_of(used_by(geometry.caster_faces, geometry.vertices))
        program = "shadow-volume/corner.vert", "shadow-volume/layers.frag"
        self._fill = stage.program(*program, "shadow-volume/layers.geom")
        self._outline = stage.program(*program, "shadow-volume/outline.geom")
        self._drawn = [
            (
                surface is casters.open,
                stage.indexed(self._fill, surface.faces),
                stage.indexed(self._outline, surface.edges, moderngl.LINES_ADJACENCY),
            )
            for surface in (casters.closed, casters.open)
            if len(surface.faces)
        ]
        self._counts = stage.texture(_SIZE, dtype="f2")  # exact up to 2048, and never below that for larger sums
        self._target = stage.target(self._counts)
        self._bounds = MinMaxReduction(stage, _SIZE, "values")

    def __call__(self, frame: Frame, count_both_facings: bool) -> float:
        """Upper bound on the layers along any light ray. Stalls until the device has finished."""
        faces = _to_faces(frame.light, self._corners)
        tiles = (1, 1) if len(faces) == 1 else (3, 2)
        world_to_face = np.zeros((6, 4, 4))
        world_to_face[: len(faces)] = faces
        texel = tuple(2.0 * tile / size for tile, size in zip(tiles, _SIZE, strict=True))
        self._target.clear()
        state = State(depth_clamp=True, blend="add", clip_distances=4)
        for program in (self._fill, self._outline):
            program.set(light=frame.light_uniform, world_to_face=world_to_face, faces=len(faces))
        self._outline.set(texel=texel)
        for is_open, fill, outline in self._drawn:
            for drawable in (fill, outline):
                drawable.program.set(count_both_facings=count_both_facings or is_open)
                drawable.draw(self._target, state=state)
        _, highest = self._bounds({"values": (self._counts, Sampling())})
        return float(highest[0])


def _to_faces(light: Light, corners: Floats) -> Floats:
    """(1 or 6, 4, 4) world to clip space of a directional light's view of a box, or of a point light's cube faces.

    corners: (2, 3) lowest and highest corner of the box.
    """
    if light.kind != "directional":
        return np.stack([_cube_face(np.array(axis, float), np.array(light.position)) for axis in _FACES])
    basis = perpendicular_basis(-unit(light.direction), (0.0, 1.0, 0.0))
    half = np.abs(basis) @ ((corners[1] - corners[0]) / 2) * 1.001
    half = np.maximum(half, 1e-4 * half.max())  # flat casters have no extent along an axis
    matrix = np.eye(4)
    matrix[:3, :3] = basis / half[:, None]
    matrix[:3, 3] = -matrix[:3, :3] @ corners.mean(axis=0)
    return matrix[None]


def _cube_face(axis: Floats, position: Floats) -> Floats:
    basis = perpendicular_basis(-axis, (0.0, 1.0, 0.0))
    matrix = np.zeros((4, 4))
    matrix[:2, :3] = basis[:2]
    matrix[3, :3] = axis
    matrix[:, 3] = -matrix[:, :3] @ position
    return matrix
