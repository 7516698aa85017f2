"""Shadow volume geometry, extruded by geometry shaders or, to check these, by NumPy."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.topology import Casters, Indices, Surface
from shadowbench.gl.program import Program, Sampling, State, Texture
from shadowbench.scenes.model import Floats
from shadowbench.techniques.base import Frame, Stage, TechniqueParams
from shadowbench.techniques.culling import kept_ranges, may_shadow

Extrusion = Literal["triangle", "silhouette"]
VolumePart = Literal["wall", "cap"]
Singles = NDArray[np.float32]

_PARTS: tuple[VolumePart, ...] = ("wall", "cap")


@dataclass(frozen=True, eq=False)
class RenderPass:
    """Render target, textures and state of one draw."""

    target: moderngl.Framebuffer
    textures: Mapping[str, tuple[Texture, Sampling]]
    state: State


class Volumes(Protocol):
    """Draws the walls or caps of all shadow volumes.

    Each has an integer weight. Walls are wound a, b, infinity, and caps as their triangles: seen from the light, a cap
    of positive weight is counter-clockwise. `culled`: number of parts that cannot shadow the visible region.
    """

    culled: int

    def extrude(self, frame: Frame, count_both_facings: bool) -> None:
        """Extrude for the frame's light.

        count_both_facings: extrude all triangles of closed parts too, not only those that face the light.
        """

    def set_camera(self, frame: Frame, world_to_clip: Floats, planes: Floats) -> None:
        """Set the frame's camera, and cull parts that cannot shadow the region inside (P, 4) planes.

        P = 0: no culling.
        """

    def draw(self, part: VolumePart, sign: int, front_adds: int, render_pass: RenderPass) -> None:
        """Draw the walls or the caps.

        sign: 1 or −1 draws those with a weight of that sign, as many times as their weight; 0 draws all once.
        front_adds: in a colour target, counter-clockwise faces add front_adds · weight, others subtract it.
        """


class ShaderVolumes:
    """Shadow volumes extruded by geometry shaders; silhouette edges are found from lines with adjacency."""

    def __init__(self, stage: Stage, casters: Casters, faces: Extrusion, params: TechniqueParams) -> None:
        self._programs: dict[VolumePart, Program] = {
            part: stage.program(
                "shadow-volume/corner.vert",
                "shadow-volume/count.frag",
                f"shadow-volume/{faces if part == 'wall' else part}.geom",
                params=params,
                defines={part.upper(): 1},
            )
            for part in _PARTS
        }
        self._surfaces = (casters.closed, casters.open)
        walls = moderngl.LINES_ADJACENCY if faces == "silhouette" else moderngl.TRIANGLES
        self._modes: dict[VolumePart, int] = {"wall": walls, "cap": moderngl.TRIANGLES}
        self._drawn = {
            part: [stage.indexed(self._programs[part], _indices(surface, mode)[0], mode) for surface in self._surfaces]
            for part, mode in self._modes.items()
        }

    def extrude(self, frame: Frame, count_both_facings: bool) -> None:
        self._count_both_facings = count_both_facings
        for program in self._programs.values():
            program.set(light=frame.light_uniform)

    def set_camera(self, frame: Frame, world_to_clip: Floats, planes: Floats) -> None:
        _set_camera(self._programs, frame, world_to_clip)
        # Whole parts only: the counts of a part's walls and caps along a camera ray cancel only together.
        kept = [may_shadow(surface.boxes, frame.light_uniform, planes) for surface in self._surfaces]
        self._ranges = {
            part: [
                kept_ranges(chosen, _indices(surface, mode)[1])
                for surface, chosen in zip(self._surfaces, kept, strict=True)
            ]
            for part, mode in self._modes.items()
        }
        self.culled = sum(int((~chosen).sum()) for chosen in kept)

    def draw(self, part: VolumePart, sign: int, front_adds: int, render_pass: RenderPass) -> None:
        program = self._programs[part]
        program.set(sign_drawn=float(sign), front_adds=float(front_adds))
        for is_open, drawable, ranges in zip((False, True), self._drawn[part], self._ranges[part], strict=True):
            program.set(count_both_facings=self._count_both_facings or is_open)
            drawable.draw(render_pass.target, render_pass.textures, render_pass.state, ranges)


def _indices(surface: Surface, mode: int) -> tuple[Indices, Indices]:
    """Vertex indices of a surface's edges or triangles, and the (P,) index after the last one of each part."""
    if mode == moderngl.LINES_ADJACENCY:
        return surface.edges, 4 * surface.edge_ends
    return surface.faces, 3 * surface.face_ends


def _set_camera(programs: Mapping[VolumePart, Program], frame: Frame, world_to_clip: Floats) -> None:
    for program in programs.values():
        program.set(world_to_clip=world_to_clip)
        if program.has("eye"):
            program.set(eye=frame.camera.position)


class ArrayVolumes:
    """Shadow volumes of single triangles, extruded by NumPy in float32 as in the shaders. No culling."""

    culled = 0

    def __init__(self, stage: Stage, casters: Casters, params: TechniqueParams) -> None:
        self._programs: dict[VolumePart, Program] = {
            part: stage.program(
                "shadow-volume/volume.vert", "shadow-volume/count.frag", params=params, defines={part.upper(): 1}
            )
            for part in _PARTS
        }
        self._edges = "from" in self._programs["wall"].linked  # declared only with compare=position
        edges = {"from": 3, "to": 3} if self._edges else {}
        attributes = {"wall": {"point": 4} | edges, "cap": {"point": 4}}
        self._uploads = {
            (part, sign): stage.stream(self._programs[part], attributes[part]) for part in _PARTS for sign in (1, -1)
        }
        self._vertices = stage.scene.geometry.vertices.astype(np.float32)
        self._surfaces = [(casters.closed.faces, False), (casters.open.faces, True)]

    def extrude(self, frame: Frame, count_both_facings: bool) -> None:
        light = np.array(frame.light_uniform, dtype=np.float32)
        for program in self._programs.values():
            if program.has("light"):
                program.set(light=frame.light_uniform)
        counted = [self._counted(faces, light, count_both_facings or is_open) for faces, is_open in self._surfaces]
        faces, weights = (np.concatenate(parts) for parts in zip(*counted, strict=True))
        makers = {"wall": self._walls, "cap": self._caps}
        self._drawn = {
            (part, sign): upload(makers[part](faces, weights * sign, light))
            for (part, sign), upload in self._uploads.items()
        }

    def set_camera(self, frame: Frame, world_to_clip: Floats, planes: Floats) -> None:
        _set_camera(self._programs, frame, world_to_clip)

    def draw(self, part: VolumePart, sign: int, front_adds: int, render_pass: RenderPass) -> None:
        for one in (sign,) if sign else (1, -1):
            self._programs[part].set(sign_drawn=float(one), front_adds=float(front_adds))
            self._drawn[part, one].draw(render_pass.target, render_pass.textures, render_pass.state)

    def _counted(self, faces: Indices, light: Singles, count_both_facings: bool) -> tuple[Indices, Singles]:
        """The faces to extrude, and their weights: 1 if counter-clockwise seen from the light, else −1."""
        order = np.argsort(faces, axis=1)
        parity = np.where((np.diff(order, axis=1) % 3 == 1).all(axis=1), 1.0, -1.0)
        a, b, c = self._vertices[np.take_along_axis(faces, order, axis=1)].transpose(1, 0, 2)
        u, v, to_light = b - a, c - a, light[:3] - light[3] * a
        volume = (
            (u[:, 1] * v[:, 2] - u[:, 2] * v[:, 1]) * to_light[:, 0]
            + (u[:, 2] * v[:, 0] - u[:, 0] * v[:, 2]) * to_light[:, 1]
            + (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]) * to_light[:, 2]
        )
        side = np.where(volume > 0, parity, -parity)
        counts = count_both_facings | (side > 0)
        return faces[counts], side[counts]

    def _walls(self, faces: Indices, weights: Singles, light: Singles) -> Singles:
        start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
        drawn = np.where(start < end, 1, -1) * np.repeat(weights, 3) > 0
        low, high = np.minimum(start, end)[drawn], np.maximum(start, end)[drawn]
        a, b = self._near(low), self._near(high)
        far_a, far_b = self._far(low, light), self._far(high, light)
        corners = [a, b, far_a] if light[3] == 0 else [a, b, far_a, far_a, b, far_b]
        edge = [a[:, :3], b[:, :3]] if self._edges else []
        rows = np.stack([np.column_stack([corner, *edge]) for corner in corners], axis=1)
        return rows.reshape(-1, rows.shape[2])

    def _caps(self, faces: Indices, weights: Singles, light: Singles) -> Singles:
        faces = faces[weights > 0]
        near = self._near(faces.ravel())
        return near if light[3] == 0 else np.concatenate([near, self._far(faces[:, ::-1].ravel(), light)])

    def _near(self, corners: Indices) -> Singles:
        return np.column_stack([self._vertices[corners], np.ones(len(corners), dtype=np.float32)])

    def _far(self, corners: Indices, light: Singles) -> Singles:
        points = light[3] * self._vertices[corners] - light[:3]
        return np.column_stack([points, np.zeros(len(corners), dtype=np.float32)])
