"""Projected shadows on planar receivers (Blinn 1988, "Me and my (fake) shadow", IEEE CG&A 8(1), 82–86)."""

from collections.abc import Iterator
from itertools import product
from typing import Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.gl.matrices import view_projection
from shadowbench.gl.program import Sampling, State, Texture
from shadowbench.scenes.model import Floats, Geometry, View, bounds_of
from shadowbench.scenes.planes import Plane, find_planes
from shadowbench.techniques.base import Frame, Stage, Technique, TechniqueParams, param

_ROW = 2048  # triangles a row of a texture by triangle


class PlanarProjection(Technique):
    """Casters flattened onto each planar receiver (Blinn 1988).

    Each plane has a pass over all casters, kept to its own pixels by the G-buffer's triangles: nothing is compared in
    depth, lifted off its surface or darkened twice. Casters are cut at the plane (its own triangles are thereby left
    out) and at the light's height. A plane is coplanar triangles, connected or not. Exact on planes and blind on all
    else: curved bodies, and planes smaller than `share` or beyond the `count` largest, stay lit. The time grows with
    casters times planes seen. Where an edge is an outline for camera and light alike, a pixel centre within about
    0.001 px of it may be dark.
    """

    name = "planar-projection"
    shown_in = "table-top"

    class Params(TechniqueParams):
        """Parameters of planar-projection."""

        receives: Literal["found", "flagged"] = param("found", "planes among all meshes, or those flagged as planar")
        share: float = param(0.0005, "smallest part of the receiving area that makes a plane", ge=0, le=1)
        count: int = param(32, "most planes, the largest first", ge=1, le=1024)
        tolerance: float = param(
            5e-7,
            "share of the scene's diagonal off a plane that is still on it; twice that casts nothing",
            gt=0,
            le=0.01,
        )

    params: Params

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        assert isinstance(params, cls.Params)
        if _planes(view.scene.geometry, params, most=1):
            return None
        return "no receiver is a plane" if params.receives == "found" else "no mesh flagged as planar is a plane"

    def build(self, stage: Stage) -> None:
        self.stage, geometry = stage, stage.scene.geometry
        self.planes = _planes(geometry, self.params, self.params.count)
        self.drawn = 0
        self.corners = [_corners(geometry, plane) for plane in self.planes]
        self.shadow_program = stage.program("planar-projection/flatten.vert", "planar-projection/shadow.frag")
        low, high = geometry.bounds
        self.shadow_program.set(clearance=2 * self.params.tolerance * float(np.linalg.norm(high - low)))
        self.casters = stage.casters(self.shadow_program)
        self.plane_of_triangle = stage.texture((_ROW, -(-len(geometry.faces) // _ROW)), dtype="i4")
        self.plane_of_triangle.write(_by_triangle(self.planes, _ROW * self.plane_of_triangle.height).tobytes())
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame: Frame) -> moderngl.Texture:
        light = frame.light_uniform
        with frame.timed("flatten", changes="view"):
            self.target.clear(1.0)
            self.drawn = 0
            textures: dict[str, tuple[Texture, Sampling]] = {
                "surface_triangle": (frame.surface.triangle, Sampling()),
                "plane_of_triangle": (self.plane_of_triangle, Sampling()),
            }
            to_clip = view_projection(frame.view)
            for index, plane in self._seen(frame, to_clip):
                flattened = to_clip @ flattening(plane, np.array(light))
                self.shadow_program.set(
                    flattened_to_clip=flattened, plane=tuple(plane.tolist()), light=light, receiver=index
                )
                self.casters.draw(self.target, textures, State(clip_distances=1))
                self.drawn += 1
        return self.visibility

    def _seen(self, frame: Frame, to_clip: Floats) -> Iterator[tuple[int, Floats]]:
        """Index and equation, turned to the light, of each plane that can have a receiver in the picture."""
        light, eye = np.array(frame.light_uniform), np.append(frame.camera.position, 1.0)
        for index, plane in enumerate(self.planes):
            equation = plane.equation * np.sign(plane.equation @ light)
            # A side turned away from the light, or either of them edge-on, receives nothing.
            if equation @ light > 0.0 and equation @ eye > 0.0 and _in_frustum(self.corners[index] @ to_clip.T):
                yield index, equation

    def facts(self) -> dict[str, float]:
        share = sum(plane.share for plane in self.planes)
        return {"planes": len(self.planes), "planes_drawn": self.drawn, "planar_share": share}


def flattening(plane: Floats, light: Floats) -> Floats:
    """(4, 4) S = (π·l) I − l πᵀ (Blinn 1988): points move along their line to the light onto the plane.

    plane: (4,) π with π·l > 0; light: (4,) unit vector towards it with w = 0, or its position with w = 1. Points
    between plane and light keep a positive w.
    """
    result: Floats = (plane @ light) * np.eye(4) - np.outer(light, plane)
    return result


def _planes(geometry: Geometry, params: PlanarProjection.Params, most: int) -> tuple[Plane, ...]:
    searched = geometry.receives & geometry.planar if params.receives == "flagged" else geometry.receives
    return find_planes(geometry, searched, params.share, most, params.tolerance)


def _by_triangle(planes: tuple[Plane, ...], length: int) -> NDArray[np.int32]:
    """The index of each triangle's plane, −1 without one."""
    indices = np.full(length, -1, dtype=np.int32)
    for index, plane in enumerate(planes):
        indices[plane.triangles] = index
    return indices


def _corners(geometry: Geometry, plane: Plane) -> Floats:
    """(8, 4) homogeneous corners of the box around a plane's triangles."""
    low, high = bounds_of(geometry.vertices[np.unique(geometry.faces[plane.triangles])])
    return np.array([[*corner, 1.0] for corner in product(*zip(low, high, strict=True))])


def _in_frustum(clip: Floats) -> bool:
    """Whether no face of the frustum has all of (N, 4) clip-space points on its outer side."""
    outside = np.concatenate([clip[:, :3] > clip[:, 3:], clip[:, :3] < -clip[:, 3:]], axis=1)
    return not bool(outside.all(axis=0).any())
