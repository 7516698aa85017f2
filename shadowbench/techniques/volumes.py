"""Shadow volume geometry: the walls and caps of the casters, and which of them are drawn how far."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from shadowbench.geometry.topology import Casters, Indices, Singles
from shadowbench.gl.library import moderngl
from shadowbench.gl.program import Drawable, Sampling, State, Texture
from shadowbench.maps.culling import kept_ranges
from shadowbench.plugin.base import Frame, Stage, TechniqueParams
from shadowbench.scenes.vectors import Floats
from shadowbench.techniques.batches import Batch

Extrusion = Literal["triangle", "silhouette"]
VolumePart = Literal["wall", "cap"]
Sign = Literal[1, -1]

_SIGNS: tuple[Sign, Sign] = (1, -1)
_WALL_CORNERS = 6  # vertices of a wall in wall.vert
_ON_EDGE = 1e-6  # distance of a lamp from an edge, as a share of the coordinates: rounding
_CLOSE = 1e-3  # distance of a lamp from a triangle's plane, as a share of the triangle's size


@dataclass(frozen=True, eq=False)
class RenderPass:
    """Render target, textures and state of one draw."""

    target: moderngl.Framebuffer
    textures: Mapping[str, tuple[Texture, Sampling]]
    state: State


class Volumes:
    """Draws the walls or caps of all shadow volumes.

    Each has an integer weight, and is stored that often. Walls are wound a, b, infinity, and caps as their triangles:
    seen from the light, a cap of positive weight is counter-clockwise. Parts are numbered closed ones first. boxes:
    (P, 2, 3) their bounds; faces: (F, 3) their triangles; walls: by sign, (N, 6) float32 edges a → b of the walls with
    a weight of that sign.
    """

    def __init__(self, stage: Stage, casters: Casters, faces: Extrusion, params: TechniqueParams) -> None:
        from shadowbench.geometry.facing import cap_weights, wall_weights  # Numba takes 0.4 s to import

        parts: tuple[VolumePart, ...] = ("wall", "cap")
        self._programs = {
            part: stage.program(
                f"shadow-volume/{part}.vert", "shadow-volume/count.frag", params=params, defines={part.upper(): 1}
            )
            for part in parts
        }
        attributes = {"wall": {"a": 3, "b": 3}, "cap": {"point": 4}}
        self._uploads = {
            (part, sign): stage.stream(self._programs[part], attributes[part]) for part in parts for sign in _SIGNS
        }
        self._drawn: dict[tuple[VolumePart, Sign], Drawable] = {}
        self._single, self._cap_weights, self._wall_weights = faces == "triangle", cap_weights, wall_weights
        self._exact = stage.scene.geometry.vertices
        self._vertices = self._exact.astype(np.float32)
        self.boxes, self.faces, self._edges = casters.all.boxes, casters.all.faces, casters.all.edges
        self._face_ends, self._edge_ends = casters.all.face_ends, casters.all.edge_ends
        self._closed_faces, self._closed_edges = len(casters.closed.faces), len(casters.closed.edges)

    def extrude(self, frame: Frame, count_both_facings: bool) -> None:
        """Extrude for the frame's light.

        count_both_facings: extrude all triangles of closed parts too, not only those that face the light.
        """
        self._light = np.array(frame.light_uniform)
        self._both_from = 0 if count_both_facings else self._closed_faces
        for program in self._programs.values():
            program.set(light=frame.light_uniform)
        if self._single:
            start, end = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
            a, b, ends = np.minimum(start, end), np.maximum(start, end), 3 * self._face_ends
            caps = self._cap_weights(self._exact, self.faces, self._light, self._both_from, self._closed_faces)
            weights = np.repeat(caps, 3) * np.where(start < end, 1, -1)
        else:
            _, a, b, _ = self._edges.T
            ends, both_from = self._edge_ends, 0 if count_both_facings else self._closed_edges
            weights = self._wall_weights(self._exact, self._edges, self._light, both_from, self._closed_edges)
        self.walls, self._wall_ends = {}, {}
        for sign in _SIGNS:
            drawn, self._wall_ends[sign] = _repeated(weights, sign, ends, _WALL_CORNERS)
            self.walls[sign] = np.concatenate([self._vertices[a[drawn]], self._vertices[b[drawn]]], axis=1)
            self._drawn["wall", sign] = self._uploads["wall", sign](np.repeat(self.walls[sign], _WALL_CORNERS, axis=0))

    def silhouette(self) -> Singles:
        """(N, 6) edges a → b of the walls, with the casters to their left as seen from the light."""
        return np.concatenate([self.walls[1], np.roll(self.walls[-1], 3, axis=1)])

    def set_camera(self, frame: Frame, world_to_clip: Floats, batches: Sequence[Batch]) -> None:
        """Set the frame's camera, and extrude the caps of the batches that have any."""
        for program in self._programs.values():
            program.set(world_to_clip=world_to_clip)
        if self._programs["wall"].has("eye"):
            self._programs["wall"].set(eye=frame.camera.position)
        capped = next((batch.parts for batch in batches if batch.behind), np.zeros(len(self.boxes), dtype=bool))
        chosen = np.repeat(capped, np.diff(self._face_ends, prepend=0))
        faces = self.faces[chosen]
        both_from, closed = (int(chosen[:end].sum()) for end in (self._both_from, self._closed_faces))
        weights = self._cap_weights(self._exact, faces, self._light, both_from, closed)
        parts = np.searchsorted(self._face_ends, np.flatnonzero(chosen), side="right")
        for sign in _SIGNS:
            drawn = sign * weights > 0
            self._drawn["cap", sign] = self._uploads["cap", sign](self._caps(faces[drawn], parts[drawn], sign))

    def draw(self, part: VolumePart, batch: Batch, sign: Sign, front_adds: int, render_pass: RenderPass) -> None:
        """Draw a batch's walls or caps with a weight of this sign, as many times as their weight.

        front_adds: in a colour target, counter-clockwise faces add front_adds, others subtract it.
        """
        program, drawn = self._programs[part], self._drawn[part, sign]
        program.set(front_adds=float(front_adds))
        ranges = None  # all caps are of the one batch that is counted behind the receivers
        if part == "wall":
            program.set(far_plane=tuple(batch.far_plane.tolist()))
            if program.has("counted_behind"):
                program.set(counted_behind=batch.behind)
            ranges = kept_ranges(batch.parts, self._wall_ends[sign], batch.others)
        drawn.draw(render_pass.target, render_pass.textures, render_pass.state, ranges)

    def _caps(self, faces: Indices, parts: Indices, sign: Sign) -> Singles:
        """(N, 4) corners of the near caps and, if the light has a position, of the far caps at infinity.

        parts: (F,) of which the triangles are; sign: of the triangles' weights, 1 if they face the light.
        """
        near = self._vertices[faces.ravel()]
        points = np.column_stack([near, np.ones(len(near), dtype=np.float32)])
        if self._light[3] == 0:
            return points
        away = self._vertices[faces[:, ::-1]] - self._light[:3].astype(np.float32)
        # A triangle close to a lamp covers nearly half of all directions, and rounding would decide which half: a fan
        # around its normal covers the right one.
        one, other = away[:, 1] - away[:, 0], away[:, 2] - away[:, 0]
        normal = np.cross(one, other)
        size = np.maximum(np.abs(one), np.abs(other)).max(axis=1) * np.linalg.norm(normal, axis=1)
        close = np.abs(np.einsum("ij,ij->i", normal, away[:, 0])) < _CLOSE * size
        fan = np.empty((np.count_nonzero(close), 3, 3, 3), dtype=np.float32)
        fan[:, :, 0], fan[:, :, 1] = away[close], np.roll(away[close], -1, axis=1)
        fan[:, :, 2] = sign * normal[close, np.newaxis]
        # Of an edge with the lamp on it, whose ends are in opposite directions, rounding would decide the way between
        # them: that away from the part is the right one, and the same for both triangles.
        length = np.linalg.norm(fan[:, :, 0] - fan[:, :, 1], axis=2)
        off = np.linalg.norm(np.cross(fan[:, :, 0], fan[:, :, 1]), axis=2)
        opposite = np.einsum("fij,fij->fi", fan[:, :, 0], fan[:, :, 1]) < 0
        through = opposite & (off <= _ON_EDGE * np.abs(near).max(initial=0.0) * length)
        middle = (self._light[:3] - self.boxes[parts[close]].mean(axis=1)).astype(np.float32)
        middle = np.broadcast_to(middle[:, np.newaxis], (len(fan), 3, 3))[through]
        second = fan[through]
        second[:, 0] = middle
        fan[through, 1] = middle
        far = np.concatenate([away[~close].reshape(-1, 3), fan.reshape(-1, 3), second.reshape(-1, 3)])
        return np.concatenate([points, np.column_stack([far, np.zeros(len(far), dtype=np.float32)])])


def _repeated(weights: NDArray[np.integer], sign: Sign, ends: Indices, corners: int) -> tuple[Indices, Indices]:
    """Rows with a weight of this sign, as often as the weight, and each part's end in vertices.

    ends: (P,) index after each part's last row; corners: number of vertices of a row.
    """
    rows = np.flatnonzero(weights > 0 if sign > 0 else weights < 0)
    drawn = np.repeat(rows, np.abs(weights[rows]))
    return drawn, corners * np.searchsorted(drawn, ends)
