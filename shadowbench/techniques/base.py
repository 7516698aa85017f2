"""The contract of a technique.

`build` sees geometry, device and parameters, never a pose; whatever depends on where camera or light are is in `draw`,
and is timed. A whole technique is one file: parameters, `unsupported`, `build`, `draw`; shaders beside it or inline.
`shadowbench new-technique NAME` writes one to start from. What most are made of: `resolve.ResolvePass`, the full-screen
pass; `maps.FittedView` and `maps.CasterMap`, the light's view and the map that casters are drawn into.

What a shader is given by `stage.program(…, params=self.params)` for a parameter `key`:

    int, bool               #define KEY 1024; of a bool 1 or 0
    choice (Literal)        #define KEY_CHOICE 1, with _ in place of -
    float                   uniform float key, where the shader declares it; with metres=True it is a local length
    row (a bias, a filter)  #include <key> is its file; its own parameters are named KEY_TAPS, key_scale

and `uniform float metre`, the local length of a metre. `receiver.glsl` has a pixel's position, normal, N·L and the
direction to the light; `map.glsl` its place in a map, by the uniforms that `maps.map_uniforms` makes, and
`linear_depth.glsl` depth along the light's axis. `map.glsl` reads three defines: SIZE, from the parameter of that name;
LAYERS, the maps of an array, 1 unless defined; REVERSED, 1 where depth 1 is near, 0 unless defined.
"""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any, ClassVar

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import Changes, Clock
from shadowbench.gl.device import Device
from shadowbench.gl.gbuffer import GBuffer
from shadowbench.scenes.model import Camera, Light, LightKind, View
from shadowbench.techniques.params import TechniqueParams, param
from shadowbench.techniques.stage import Stage


@dataclass(frozen=True)
class Phase:
    """Where a map's grid lies against the scene; phase 0 is where the fit puts it."""

    index: int = 0

    @property
    def shift(self) -> tuple[float, float]:
        """The index-th Halton (2, 3) point, in texels."""
        return _radical_inverse(self.index, 2), _radical_inverse(self.index, 3)


def _radical_inverse(index: int, base: int) -> float:
    result, digit = 0.0, 1.0
    while index:
        digit /= base
        result += digit * (index % base)
        index //= base
    return result


@dataclass(frozen=True, eq=False)
class Frame:
    """All that may differ between two draws. `index` 0 says that history is void."""

    view: View
    phase: Phase
    index: int
    surface: GBuffer
    clock: Clock

    @property
    def camera(self) -> Camera:
        """The camera, in local coordinates."""
        return self.view.camera

    @property
    def light(self) -> Light:
        """The light, in local coordinates."""
        return self.view.light

    @property
    def light_uniform(self) -> tuple[float, float, float, float]:
        """`light` of receiver.glsl: the unit vector towards a directional light, w = 0; or a position, w = 1."""
        xyz, w = self.light.homogeneous
        return (*xyz, w)

    def timed(self, name: str, changes: Changes = "frame") -> AbstractContextManager[None]:
        """Bracket a pass; `changes` says when it must be redrawn: light moves; camera or light moves; always."""
        return self.clock.timed(name, changes)


class Technique(ABC):
    """One way of computing visibility. Registered by its `name`; the docstring is its documentation."""

    name: ClassVar[str]
    Params: ClassVar[type[TechniqueParams]] = TechniqueParams
    presets: ClassVar[dict[str, str]] = {}  # name: the items that it stands for, as a spec writes them
    lights: ClassVar[frozenset[LightKind]] = frozenset({"directional", "spot", "point"})  # kinds that it answers
    phased: ClassVar[bool] = False  # whether it has a grid that a phase can shift
    picture_scene: ClassVar[str] = ""  # the built-in scene whose picture its documentation shows
    # What `recommend` tries of its parameters, by name; all others at their defaults, and map sizes in any case.
    grid: ClassVar[Mapping[str, Sequence[Any]]] = {}
    never_recommended: ClassVar[str] = ""  # why `recommend` never chooses it
    only_planes: ClassVar[bool] = False  # whether receivers that are not planar stay lit
    # Geometry alone decides, without a grid or a window: tests/laws holds it to what follows from that.
    exact: ClassVar[bool] = False
    variants: ClassVar[Sequence[str]] = ("",)  # items of the specs that tests/laws looks at

    def __init__(self, params: TechniqueParams) -> None:
        self.params = params

    @classmethod
    def unsupported(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        """Why these parameters cannot answer this view on this device, in words; None when they can."""
        return None

    @classmethod
    def declines(cls, params: TechniqueParams, view: View, device: Device) -> str | None:
        """The reason of `unsupported`, or that `lights` lacks the view's; None when there is an answer."""
        reason = cls.unsupported(params, view, device)
        if reason is None and view.light.kind not in cls.lights:
            return f"a {view.light.kind} light; {cls.name} answers {' and '.join(sorted(cls.lights))} ones"
        return reason

    @classmethod
    def view_slices(cls, params: TechniqueParams) -> int:
        """How many slices of the view have a map each."""
        return 1

    @classmethod
    def extra_work(cls, params: TechniqueParams) -> str | None:
        """Why these parameters are no choice where work is what ranks, in words; None when they may be one."""
        return None

    @abstractmethod
    def build(self, stage: Stage) -> None:
        """Make programs, textures and buffers; nothing here may depend on a pose."""

    @abstractmethod
    def draw(self, frame: Frame) -> moderngl.Texture:
        """Visibility of every pixel: one float component, size × size, 1 where nothing receives."""

    def map_image(self) -> NDArray[np.float32] | None:
        """The map of the last draw as (H, W) linear depth in [0, 1], row 0 at the top; None without a map."""
        return None

    def tint(self) -> moderngl.Texture | None:
        """Colours (RGBA, linear, of the image's size) to show what the last draw did where; None without any.

        Rendering on demand: a debug picture multiplies them into its surfaces.
        """
        return None

    def facts(self) -> dict[str, float]:
        """Numbers about the last draw that explain its row, such as a bias in metres.

        `reads` (of textures) and `rays` are counted as work.
        """
        return {}


__all__ = ["Changes", "Frame", "Phase", "Stage", "Technique", "TechniqueParams", "param"]
