"""The pictures of the window: each pane's, with what explains it, and that of the shadow map."""

from collections.abc import Mapping
from typing import get_args

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.device import Device
from shadowbench.gl.program import SHADERS, Drawable, Sampling, compose, link
from shadowbench.plugin.base import Technique
from shadowbench.scores.difference import FACETS, FALSE_LIGHT, FALSE_SHADOW
from shadowbench.viewer.drawing import Drawn
from shadowbench.viewer.state import Overlay, Source, ViewerState
from shadowbench.viewer.truth import Traced

# The shader's define for each overlay, and the texture that it cannot do without.
_DEFINES: dict[Overlay, tuple[str, str]] = {
    "error": ("ERROR", "truth"),
    "mask": ("MASK", "visibility"),
    "normals": ("NORMALS", "picture"),
    "N·L": ("COSINE", "picture"),
    "texels": ("TEXELS", "texels"),
    "blockers": ("BLOCKERS", "blocker"),
}
NEEDS_TRUTH: tuple[Overlay, ...] = ("error", "blockers")
NUMBERS = {name: 1_000_001 + number for number, name in enumerate((*get_args(Source), "map"))}
"""By which the interface names the pictures, whose textures are drawn after it was laid out."""
LARGEST_MAP = 1024
"""Largest side of a shown shadow map, in pixels: of a larger one every n-th texel is shown."""


class Panes:
    """Draws the picture of each pane."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._passes: dict[Overlay, Drawable] = {}
        self._truth: dict[str, moderngl.Texture] = {}  # by their names in the shader, and of what they are
        self._truth_of: tuple[Traced, int] | None = None

    def draw(self, drawn: Drawn, state: ViewerState, source: Source, traced: Traced | None) -> moderngl.Texture | None:
        """A texture that the caller releases: the picture of A, B or the truth; None if there is none.

        state: says how to show it; traced: the truth of the drawn view, None if it is not traced yet.
        """
        truth = self._textures(traced, drawn.size) if traced else {}
        shown = _shown(drawn, source, truth)
        if shown is None:
            return None
        technique, visibility = shown
        self.device.reset()
        tint = technique.tint() if technique and state.overlay == "tint" else None
        texels = technique.texels() if technique and state.overlay == "texels" else None
        shadows = visibility if state.shadows else drawn.lit
        picture = drawn.loaded.picture_pass.shade(drawn.frame.surface, drawn.frame.view, shadows, tint, state.shading)
        textures = {"picture": picture, "visibility": visibility, **truth, **({"texels": texels} if texels else {})}
        if state.overlay not in _DEFINES or _DEFINES[state.overlay][1] not in textures:
            return picture
        overlaid = self._overlaid(drawn, state.overlay, textures, soft=bool(traced and traced.soft))
        self.device.free((picture,))
        return overlaid

    def _overlaid(
        self, drawn: Drawn, overlay: Overlay, textures: Mapping[str, moderngl.Texture], soft: bool
    ) -> moderngl.Texture:
        """The picture among some textures, with what they say of it."""
        one, (xyz, w) = self._pass(overlay), drawn.frame.light.homogeneous
        one.program.set(light=(*xyz, w))
        if overlay == "error":
            colors = {"false_shadow": FALSE_SHADOW, "false_light": FALSE_LIGHT, "dark_facet": FACETS}
            shares = {name: tuple(level / 255 for level in color) for name, color in colors.items()}
            one.program.set(**shares, soft=float(soft))
        result = self.device.context.texture(textures["picture"].size, 4, dtype="f1")
        target = self.device.context.framebuffer([result])
        sampled = {name: (texture, Sampling()) for name, texture in textures.items()}
        one.draw(target, {**drawn.frame.surface.inputs, **sampled})
        self.device.free((target,))
        return result

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
        """Free everything, so that changed shaders are read again."""
        for one in self._passes.values():
            self.device.free((one.vertices, one.program.linked))
        self._passes.clear()
        self._free_truth()

    def _pass(self, overlay: Overlay) -> Drawable:
        if overlay not in self._passes:
            fragment = compose("viewer/overlay.frag", SHADERS, {f"OVERLAY_{_DEFINES[overlay][0]}": "1"})
            program = link(self.device, compose("fullscreen.vert", SHADERS), fragment)
            vertices = self.device.context.vertex_array(program.linked, [])
            self._passes[overlay] = Drawable(program, vertices, count=3)
        return self._passes[overlay]

    def _textures(self, traced: Traced, size: int) -> dict[str, moderngl.Texture]:
        """A truth as textures, made once: visibility, whether scored, whether a facet; blockers' distances, up to 1."""
        if self._truth_of != (traced, size):
            self._free_truth()
            known = np.isfinite(traced.blocker)
            blocker = np.where(known, traced.blocker / traced.blocker.max(where=known, initial=1e-30), -1.0)
            images = {"truth": np.dstack([traced.visibility, traced.scored, traced.facets]), "blocker": blocker}
            self._truth = {name: self._texture(image, size) for name, image in images.items()}
            self._truth_of = (traced, size)
        return self._truth

    def _texture(self, values: NDArray[np.floating], size: int) -> moderngl.Texture:
        """A texture of size × size pixels, each the nearest of a perhaps coarser image with row 0 at the top."""
        nearest = (np.arange(size) * len(values)) // size
        pixels = values[nearest[::-1, np.newaxis], nearest].astype(np.float32)
        return self.device.context.texture((size, size), pixels.size // size**2, pixels.tobytes(), dtype="f4")

    def _free_truth(self) -> None:
        self.device.free(self._truth.values())
        self._truth, self._truth_of = {}, None


def _shown(
    drawn: Drawn, source: Source, truth: Mapping[str, moderngl.Texture]
) -> tuple[Technique | None, moderngl.Texture] | None:
    """The technique of a source, and its visibility: 1 where it failed; None if there is nothing to show."""
    if source == "truth":
        return (None, truth["truth"]) if truth else None
    mask = dict(zip("AB", drawn.masks, strict=False)).get(source)
    return (mask.technique, mask.visibility or drawn.lit) if mask else None
