"""A scene on the GPU, and what drawing a cell in it yields: images, GPU memory, work counts and facts."""

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.files import png_of
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import FacetPass, GBuffer, GBufferPass, download
from shadowbench.gl.geometry import DeviceGeometry
from shadowbench.gl.picture import PicturePass
from shadowbench.maps.filters import Filter
from shadowbench.plugin.base import Stage, Technique
from shadowbench.plugin.registry import shader_folder
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Coordinates, Scene, View
from shadowbench.scenes.scene_tables import LONGEST_NAME
from shadowbench.scores.masks import quantise


@dataclass(frozen=True, eq=False)
class Rendering:
    """Images and measurements of one draw; row 0 of images is at the top.

    visibility: (N, N) float32, 0 in shadow to 1 lit, quantised to 16 bits; picture: (N, N, 3) uint8 sRGB, shaded with
    the visibility; map: (H, W) float32 linear depth, None if not requested or the technique has none; gpu_bytes: of its
    textures and buffers; work: counts by name; facts: numbers reported by the technique, by name.

    Of another engine, gpu_bytes is None; engine: its version, its renderer, whose light box it is (`given`, `own`), and
    what a phase shifts (`box`, `none`); measurable: (N, N) bool, where its pictures are bright enough.
    """

    visibility: NDArray[np.float32]
    picture: NDArray[np.uint8]
    map: NDArray[np.float32] | None
    gpu_bytes: int | None
    work: dict[str, int]
    facts: dict[str, float]
    engine: Mapping[str, str] | None = None
    measurable: NDArray[np.bool_] | None = None

    def __repr__(self) -> str:
        """One line: the sizes of its images."""
        size = len(self.visibility)
        shadow_map = "no map" if self.map is None else f"a map of {self.map.shape[1]} × {self.map.shape[0]} texels"
        return f"<Rendering of {size} × {size} pixels, {(self.visibility < 0.5).mean():.1%} in shadow, {shadow_map}>"

    def _repr_png_(self) -> bytes:
        """PNG of the picture, for notebooks."""
        return png_of(self.picture)


class Surface(NamedTuple):
    """What masks of a view are drawn over; row 0 is at the top.

    triangle: (N, N) int32 triangle ids, None if the renderer does not tell; lit, ambient: pictures, (N, N, 3) uint8
    sRGB, with visibility 1 everywhere and 0 everywhere, from which a mask's picture is blended.
    """

    triangle: NDArray[np.int32] | None
    lit: NDArray[np.uint8]
    ambient: NDArray[np.uint8]


def checked_texture(spec: str, texture: object, size: int) -> moderngl.Texture:
    """What a technique drew. TypeError or ValueError unless it is a texture, size × size, with one component."""
    if not isinstance(texture, moderngl.Texture):
        raise TypeError(f"{spec} drew {type(texture).__name__}; allowed: a texture")
    if texture.size != (size, size):
        raise ValueError(f"{spec} drew {' × '.join(map(str, texture.size))} pixels; allowed: {size} × {size}")
    if texture.components != 1:
        raise ValueError(f"{spec} drew {texture.components} components; allowed: 1, the visibility")
    return texture


def visibility_of(spec: str, texture: object, size: int) -> NDArray[np.float32]:
    """(size, size) quantised visibility that a technique drew, row 0 at the top.

    Raises as `checked_texture` does, and ValueError for values that are not finite or not in [0, 1].
    """
    drawn = checked_texture(spec, texture, size)
    try:
        return quantise(download(drawn)[..., 0])
    except ValueError as error:
        raise ValueError(f"{spec} drew {error}") from error


def declared_work(technique: Technique, pixels: int, facts: dict[str, float]) -> dict[str, int]:
    """Work that OpenGL does not count: shadow-map reads and rays, moved here from `facts` if reported there.

    A technique with a built-in filter reads as many texels per pixel as the filter declares.
    """
    work: dict[str, int] = {name: int(facts.pop(name)) for name in ("reads", "rays") if name in facts}
    chosen = getattr(technique.params, "filter", None)
    if "reads" not in work and isinstance(chosen, Filter):
        work["reads"] = pixels * chosen.reads
    return work


def finite_facts(spec: str, facts: Mapping[str, float]) -> dict[str, float]:
    """Facts as plain floats. Raises ValueError if one is not finite or its name is longer than LONGEST_NAME."""
    for name, value in facts.items():
        if len(name) > LONGEST_NAME:
            raise ValueError(
                f"{spec}: fact {name!r:.60}… has a name of {len(name)} characters; allowed: {LONGEST_NAME}"
            )
        if not math.isfinite(value):
            raise ValueError(f"{spec}: fact {name!r} is {value}; allowed: finite numbers")
    return {name: float(value) for name, value in facts.items()}


class LoadedScene:
    """A scene on the GPU: its buffers and passes, in the coordinates in which it is drawn."""

    def __init__(self, device: Device, file_scene: Scene, coordinates: Coordinates) -> None:
        self.device, self.file_scene, self.coordinates = device, file_scene, coordinates
        self.placement = file_scene.placement if coordinates == "relative" else IDENTITY_PLACEMENT
        self.scene = self.placement.scene(file_scene)
        self.geometry = DeviceGeometry(device, self.scene.geometry)
        self.surface_pass = GBufferPass(device, self.geometry)
        self.picture_pass = PicturePass(device, self.geometry)
        self.facet_pass = FacetPass(device) if self.scene.geometry.smooth else None

    def matches(self, scene: Scene, coordinates: Coordinates) -> bool:
        """Whether it is a scene in these coordinates."""
        return scene is self.file_scene and coordinates == self.coordinates

    def to_drawing_coordinates(self, view: View) -> View:
        """A view of this scene converted from file coordinates (near and far planes known) to drawing coordinates."""
        return View(self.scene, self.placement.camera(view.camera), self.placement.light(view.light), view.size)

    def darken_facets(self, spec: str, technique: Technique, texture: object, surface: GBuffer, view: View) -> None:
        """Make what a technique drew 0 where triangles hide from the light what the smooth surface shows it.

        surface: with the triangles. Not if the technique lifts its receivers. Raises as `checked_texture` does.
        """
        if self.facet_pass is not None and not technique.lifts(technique.params):
            self.facet_pass.draw(checked_texture(spec, texture, view.size), surface, view)

    def build(self, spec: Spec, size: int, room: int = sys.maxsize) -> tuple[Technique, Stage]:
        """A technique built for images of size × size pixels. Raises any exception of the technique.

        room: most bytes that its textures and buffers may take. Raises Unsupported if they would take more.
        """
        folder = shader_folder(spec.drawn_here)
        stage = Stage(self.scene, self.device, (size, size), self.geometry, self.placement, folder, room)
        technique = spec.drawn_here(spec.params)
        try:
            technique.build(stage)
            self.device.check(f"building {spec.full_text}")
        except BaseException:
            stage.release()
            raise
        return technique, stage

    def release(self) -> None:
        """Free GPU memory."""
        self.picture_pass.release()
        if self.facet_pass is not None:
            self.facet_pass.release()
        self.surface_pass.release()
        self.geometry.release()
