"""Projected shadows on planar receivers (Blinn 1988, "Me and my (fake) shadow", IEEE CG&A 8(1), 82–86)."""

from collections.abc import Iterator

import numpy as np

from shadowbench.geometry.convex import box_planes, corners, is_outside, view_planes
from shadowbench.geometry.planes import LEAST_SHARE, MOST_PLANES, TOLERANCE, find_planes
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import triangle_texels, view_projection
from shadowbench.gl.program import Sampling, State, Texture
from shadowbench.plugin.base import Entry, Frame, Stage, Technique, TechniqueParams, param
from shadowbench.scenes.model import View
from shadowbench.scenes.triangles import bounds_of, used_by
from shadowbench.scenes.vectors import Floats, vec3

_ROUNDING = 1e-6  # of the diagonal: exceeds the float32 distance of a plane's own corners from it near the origin
_FLOAT_STEP = 2.0**-23  # of a coordinate: twice its float32 rounding error


class PlanarProjection(Technique):
    """Casters flattened onto each planar receiver (Blinn 1988).

    One pass over all casters per plane, restricted to the plane's pixels by the G-buffer's triangle indices, so that no
    depth comparison, bias or blending is needed. Casters are clipped at the plane, which also removes its own
    triangles, and at the light's height. Exact on planes. All other receivers stay lit: curved surfaces, planes smaller
    than `share`, and all but the `count` largest. The time grows with the number of casters times visible planes.

    Triangles are coplanar, connected or not, if their corners are within `tolerance` of the plane. The default suits
    meshes written with 4 decimals over 10 m. Casters closer to a plane than its own corners cast no shadow on it: a
    decal within the tolerance is part of the surface below.
    """

    name = "planar-projection"
    catalogue = Entry(
        picture_scene="table-top",
        only_planes=True,
        exact=True,
        variants=("count=1024",),  # all planes: rounding decides which of equally large planes would be dropped
    )

    class Params(TechniqueParams):
        share: float = param(LEAST_SHARE, "smallest area of a plane, as a share of all receivers' area", ge=0, le=1)
        count: int = param(MOST_PLANES, "largest number of planes; the largest planes are kept", ge=1, le=1024)
        tolerance: float = param(
            TOLERANCE,
            "largest distance of a plane's corners from it, as a share of the scene's diagonal",
            gt=0,
            le=0.01,
        )

    params: Params

    @classmethod
    def unsupported(cls, params: Params, view: View, device: Device) -> str | None:
        geometry = view.scene.geometry
        planes = find_planes(geometry, params.share, 1, params.tolerance)
        return None if planes else "no receiver is a plane"

    def build(self, stage: Stage) -> None:
        self.stage, geometry = stage, stage.scene.geometry
        params = self.params
        self.planes = find_planes(geometry, params.share, params.count, params.tolerance)
        self.drawn = 0
        bounds = [bounds_of(used_by(geometry.faces[plane.triangles], geometry.vertices)) for plane in self.planes]
        self.corners = [corners(box_planes(box), float(np.abs(box).max())) for box in bounds]
        low, high = geometry.bounds
        far = float(np.abs(geometry.bounds).max())
        self.rounding = _ROUNDING * float(np.linalg.norm(high - low)) + _FLOAT_STEP * far
        self.from_center = np.eye(4)
        self.from_center[:3, 3] = (low + high) / 2
        self.shadow_program = stage.program("planar-projection/flatten.vert", "planar-projection/shadow.frag")
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
            for index, plane in self._lit_visible_planes(frame):
                self.shadow_program.set(
                    flattened_to_clip=to_clip @ flattening(plane, light) @ self.from_center,
                    plane=tuple((plane @ self.from_center).tolist()),
                    clearance=self.planes[index].thickness + self.rounding,
                    receiver=index,
                )
                self.casters.draw(self.target, textures, State(clip_distances=1))
                self.drawn += 1
        return self.visibility

    def _lit_visible_planes(self, frame: Frame) -> Iterator[tuple[int, Floats]]:
        """Index and equation, with the normal towards the light, of each plane that may have visible receivers."""
        eye, light = np.array(frame.camera.eye), np.array(frame.light_uniform)
        frustum = view_planes(frame.view)
        for index, plane in enumerate(self.planes):
            equation = plane.equation * np.sign(plane.equation @ light)
            # A side that faces away from the light receives nothing, nor does a plane edge-on to light or camera.
            if equation @ light > 0.0 and equation @ eye > 0.0 and not is_outside(self.corners[index], frustum):
                yield index, equation

    def facts(self) -> dict[str, float]:
        share = sum(plane.share for plane in self.planes)
        return {"planes": len(self.planes), "planes_drawn": self.drawn, "planar_share": share}


def flattening(plane: Floats, light: Floats) -> Floats:
    """(4, 4) projection of points from the light onto a plane, S = (π·l) I − l πᵀ (Blinn 1988).

    plane: (4,) π with π·l > 0; light: (4,) unit vector towards it with w = 0, or its position with w = 1. Points
    between plane and light have a positive w.
    """
    result: Floats = (plane @ light) * np.eye(4) - np.outer(light, plane)
    return result
