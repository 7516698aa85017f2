"""The pictures of the window: each pane's, with what explains it, and that of the shadow map."""

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.files import data_folder
from shadowbench.gl.device import Device
from shadowbench.gl.program import Drawable, Sampling, link
from shadowbench.gl.shaders import compose
from shadowbench.plugin.base import Technique
from shadowbench.scores.difference import FALSE_LIGHT, FALSE_SHADOW
from shadowbench.viewer.drawing import Drawn
from shadowbench.viewer.state import Overlay, Source, ViewerState
from shadowbench.viewer.truth import Traced

_DEFINES: dict[Overlay, str] = {
    "error": "ERROR",
    "mask": "MASK",
    "normals": "NORMALS",
    "N·L": "COSINE",
    "texels": "TEXELS",
    "blockers": "BLOCKERS",
}
NEEDS_TRUTH: tuple[Overlay, ...] = ("error", "blockers")
NUMBERS = {"A": 1_000_001, "B": 1_000_002, "truth": 1_000_003, "map": 1_000_004}
"""By which the interface names the pictures, whose textures are drawn after it was laid out."""
LARGEST_MAP = 1024
"""Largest side of a shown shadow map, in pixels: of a larger one every n-th texel is shown."""


@dataclass(frozen=True, eq=False)
class TruthTextures:
    """A truth as textures of a size: visibility with, in y, whether a pixel is scored; blockers' distances, up to 1."""

    device: Device
    traced: Traced
    size: int
    visibility: moderngl.Texture
    blocker: moderngl.Texture

    @staticmethod
    def of(device: Device, traced: Traced, size: int) -> "TruthTextures":
        """The textures of a truth; a coarse one is enlarged."""
        near = traced.blocker[np.isfinite(traced.blocker)]
        reach = float(near.max()) if near.size else 1.0
        blocker = np.where(np.isfinite(traced.blocker), traced.blocker / max(reach, 1e-30), -1.0)
        scored = np.dstack([traced.visibility, traced.scored])
        textures = (_texture(device, _enlarged(values, size)) for values in (scored, blocker))
        return TruthTextures(device, traced, size, *textures)

    def release(self) -> None:
        """Free the textures."""
        self.device.free((self.visibility, self.blocker))


class Panes:
    """Draws the picture of each pane."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._passes: dict[Overlay, Drawable] = {}

    def draw(
        self, drawn: Drawn, state: ViewerState, source: Source, truth: TruthTextures | None
    ) -> moderngl.Texture | None:
        """A texture that the caller releases: the picture of A, B or the truth; None if there is none.

        state: says how to show it; truth: of the drawn view and size, None if it is not traced yet.
        """
        mask = None
        if source == "truth":
            if truth is None:
                return None
            visibility = truth.visibility
        elif "AB".index(source) < len(drawn.masks):
            mask = drawn.masks["AB".index(source)]
            visibility = mask.visibility or drawn.lit  # where it failed, the scene without shadows
        else:
            return None
        technique = None if mask is None else mask.technique
        self.device.reset()
        tint = technique.tint() if technique and state.overlay == "tint" else None
        texels = technique.texels() if technique and state.overlay == "texels" else None
        shown = visibility if state.shadows else drawn.lit
        picture = drawn.loaded.picture_pass.shade(drawn.frame.surface, drawn.frame.view, shown, tint, state.shading)
        if self._is_plain(state.overlay, truth, texels):
            return picture
        target_texture = self.device.context.texture(picture.size, 4, dtype="f1")
        target = self.device.context.framebuffer([target_texture])
        xyz, w = drawn.frame.light.homogeneous
        one = self._pass(state.overlay)
        one.program.set(light=(*xyz, w))
        if state.overlay == "error" and truth is not None:
            colors = (tuple(level / 255 for level in color) for color in (FALSE_SHADOW, FALSE_LIGHT))
            for name, color in zip(("false_shadow", "false_light"), colors, strict=True):
                one.program.set(**{name: color})
            one.program.set(soft=float(truth.traced.soft))
        inputs = {
            **drawn.frame.surface.inputs,
            "picture": (picture, Sampling()),
            "visibility": (visibility, Sampling()),
        }
        if truth is not None:
            inputs |= {"truth": (truth.visibility, Sampling()), "blocker": (truth.blocker, Sampling())}
        if texels is not None:
            inputs["texels"] = (texels, Sampling())
        one.draw(target, inputs)
        self.device.free((target, picture))
        return target_texture

    def map_picture(self, technique: Technique) -> moderngl.Texture | None:
        """A texture that the caller releases: the map of the technique's last draw, near is dark; None without one."""
        self.device.reset()
        depths = technique.map_image()
        if depths is None:
            return None
        step = -(-max(depths.shape) // LARGEST_MAP)
        grey = np.round(np.clip(depths[::step, ::step], 0, 1) * 255).astype(np.uint8)[::-1]
        picture = np.dstack([grey, grey, grey, np.full_like(grey, 255)])
        return self.device.context.texture(grey.shape[::-1], 4, picture.tobytes())

    def reload(self) -> None:
        """Free the programs, so that changed shaders are read again."""
        for one in self._passes.values():
            self.device.free((one.vertices, one.program.linked))
        self._passes.clear()

    @staticmethod
    def _is_plain(overlay: Overlay, truth: TruthTextures | None, texels: moderngl.Texture | None) -> bool:
        lacking = (overlay in NEEDS_TRUTH and truth is None) or (overlay == "texels" and texels is None)
        return lacking or overlay not in _DEFINES

    def _pass(self, overlay: Overlay) -> Drawable:
        if overlay not in self._passes:
            roots, defines = [data_folder("shaders")], {f"OVERLAY_{_DEFINES[overlay]}": "1"}
            fragment = compose("viewer/overlay.frag", roots, defines)
            program = link(self.device, compose("fullscreen.vert", roots), fragment)
            vertices = self.device.context.vertex_array(program.linked, [])
            self._passes[overlay] = Drawable(program, vertices, count=3)
        return self._passes[overlay]


def _enlarged(values: NDArray[np.floating], size: int) -> NDArray[np.float32]:
    """(size, size, …) pixels of a smaller or larger image, each the nearest, row 0 at the bottom (OpenGL order)."""
    nearest = (np.arange(size) * len(values)) // size
    return values[nearest[::-1, np.newaxis], nearest].astype(np.float32)


def _texture(device: Device, values: NDArray[np.float32]) -> moderngl.Texture:
    height, width = values.shape[:2]
    return device.context.texture((width, height), values.size // (height * width), values.tobytes(), dtype="f4")
