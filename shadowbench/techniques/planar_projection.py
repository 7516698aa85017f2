"""Projected shadows on planar receivers (Blinn 1988, "Me and my (fake) shadow", IEEE CG&A 8(1), 82–86)."""

from collections.abc import Iterator
from typing import Literal

import moderngl
import numpy as np

from shadowbench.geometry.convex import box_planes, corners, is_outside, view_planes
from shadowbench.geometry.planes import LEAST_SHARE, MOST_PLANES, TOLERANCE, Plane, find_planes
from shadowbench.gl.device import Device
from shadowbench.gl.geometry import TRIANGLE_DEFINES, triangle_texels
from shadowbench.gl.matrices import view_projection
from shadowbench.gl.program import Sampling, State, Texture
from shadowbench.scenes.geometry import Geometry, bounds_of, used_by
from shadowbench.scenes.model import Floats, View, vec3
from shadowbench.techniques.base import Frame, Stage, Technique, TechniqueParams, param

_ROUNDING = 1e-6  # of the diagonal: more than float32 lifts a plane's own corners off it near the origin
_FLOAT_STEP = 2.0**-23  # of a coordinate: what float32 rounds it by, twice


class PlanarProjection(Technique):
    """Casters flattened onto each planar receiver (Blinn 1988).

    Each plane has a pass over all casters, kept to its own pixels by the G-buffer's triangles: nothing is compared in
    depth, lifted off its surface or darkened twice. Casters are cut at the plane (its own triangles are thereby left
    out) and at the light's height. A plane is coplanar triangles, connected or not. Exact on planes and blind on all
    else: curved bodies, and planes smaller than `share` or beyond the `count` largest, stay lit. The time grows with
    casters times planes seen.

    Coplanar is what lies within `tolerance`, which holds meshes written with 4 decimals in 10 m or with 6 digits; at 3
    decimals a tessellated slope falls into many planes or none, unless it is raised. What is closer to a plane than the
    plane's own corners, or than a millionth of the scene's diagonal, casts nothing on it: a decal within the tolerance
    is a part of what it lies on. Where an edge is an outline for camera and light alike, a pixel centre within about
    0.001 px of it may be dark.
    """

    name = "planar-projection"
    picture_scene = "table-top"
    only_planes = True
    exact = True
    variants = ("count=1024",)  # all planes: which of equal ones are the largest is rounding's

    class Params(TechniqueParams):
        """Parameters of planar-projection."""

        receives: Literal["found", "flagged"] = param("found", "planes among all meshes, or those flagged as planar")
        share: float = param(LEAST_SHARE, "smallest part of the receiving area that makes a plane", ge=0, le=1)
        count: int = param(MOST_PLANES, "most planes, the largest first", ge=1, le=1024)
        tolerance: float = param(
            TOLERANCE,
            "share of the scene's diagonal that a plane's corners may be off it",
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
        low, high = geometry.bounds
        far = float(np.abs(geometry.bounds).max())
        self.rounding = _ROUNDING * float(np.linalg.norm(high - low)) + _FLOAT_STEP * far
        self.from_center = np.eye(4)
        self.from_center[:3, 3] = (low + high) / 2
        self.shadow_program = stage.program(
            "planar-projection/flatten.vert", "planar-projection/shadow.frag", defines=TRIANGLE_DEFINES
        )
        self.shadow_program.set(center=vec3(self.from_center[:3, 3]))
        self.casters = stage.casters(self.shadow_program)
        of_triangle = np.full(len(geometry.faces), -1, dtype=np.int32)
        for index, plane in enumerate(self.planes):
            of_triangle[plane.triangles] = index
        texels = triangle_texels(of_triangle)
        self.plane_of_triangle = stage.texture(texels.shape[::-1], dtype="i4")
        self.plane_of_triangle.write(texels.tobytes())
        self.visibility = stage.texture()
        self.target = stage.target(self.visibility)

    def draw(self, frame: Frame) -> moderngl.Texture:
        light = np.array(frame.light_uniform)
        with frame.timed("flatten", changes="view"):
            self.target.clear(1.0)
            self.drawn = 0
            textures: dict[str, tuple[Texture, Sampling]] = {
                "surface_triangle": (frame.surface.triangle, Sampling()),
                "plane_of_triangle": (self.plane_of_triangle, Sampling()),
            }
            to_clip = view_projection(frame.view)
            for index, plane in self._seen(frame):
                self.shadow_program.set(
                    flattened_to_clip=to_clip @ flattening(plane, light) @ self.from_center,
                    plane=tuple((plane @ self.from_center).tolist()),
                    clearance=self.planes[index].thickness + self.rounding,
                    receiver=index,
                )
                self.casters.draw(self.target, textures, State(clip_distances=1))
                self.drawn += 1
        return self.visibility

    def _seen(self, frame: Frame) -> Iterator[tuple[int, Floats]]:
        """Index and equation, turned to the light, of each plane that can have a receiver in the picture."""
        eye, light = np.array(frame.camera.position), np.array(frame.light_uniform)
        frustum = view_planes(frame.view)
        for index, plane in enumerate(self.planes):
            equation = plane.equation * np.sign(plane.equation @ light)
            # A side turned away from the light, or either of them edge-on, receives nothing.
            if equation @ light > 0.0 and equation @ [*eye, 1.0] > 0.0 and not is_outside(self.corners[index], frustum):
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


def _corners(geometry: Geometry, plane: Plane) -> Floats:
    """(N, 3) corners of the box around a plane's triangles."""
    bounds = bounds_of(used_by(geometry.faces[plane.triangles], geometry.vertices))
    return corners(box_planes(bounds), float(np.abs(bounds).max()))
