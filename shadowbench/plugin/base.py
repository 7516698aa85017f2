"""Base class of shadow techniques.

`build` gets geometry, device and parameters, but no camera or light pose. All work that depends on the camera or the
light is done, and timed, in `draw`. A technique is one file with its parameters, `unsupported`, `build` and `draw`; its
shaders are inline or files in the same folder. `shadowbench new-technique NAME` writes a working one to start from.
Common parts, in `shadowbench.maps`: `caster_map.ResolvePass`, the full-screen pass; `fits.FittedView`, the light's
view; `caster_map.CasterMap`, the map that the casters are rendered into.

`stage.program(…, params=self.params)` passes a parameter `key` to the shader by its type:

    int, bool               #define KEY 1024; a bool is 1 or 0
    choice (Literal)        #define KEY_CHOICE 1, with _ for -; #include "folder/<key>.glsl" includes choice.glsl
    float                   uniform float key, if the shader declares it; with metres=True in local lengths
    component (a bias, …)   #include <key> includes its file; its own parameters are named KEY_TAPS, key_scale

and `uniform float metre` is one metre in local lengths. `receiver.glsl` reads a pixel's position, normal, N·L and the
direction to the light from the G-buffer; `map.glsl` computes its point in a shadow map, the depth along the light's
axis among it, from the uniforms of `caster_map.map_uniforms`, and uses two defines: SIZE, from the parameter of that
name, and LAYERS, the number of maps in an array (default 1). `shadow_map.glsl` is the whole lookup,
`lit(bias(receiver))`, of the parts that `caster_map.FilteredMap` chooses.

Casters cut out by alpha are drawn whole by shaders that do not test it. Those that do, as `casters.vert` and
`depth.frag`, include `cutout.glsl`, and call `pass_cutout()`, in a geometry shader `pass_cutout(corner)`, and
`cut_out()`. A ray asks its `is_opaque`, with the textures `stage.cutouts` and the defines CUTOUTS and RAYS.

A plug-in may also define a filter or a bias, which every technique whose kind of map it supports then has: a subclass
of `filters.Filter` or `biases.Bias`, whose `shader`, and a bias's `comparison`, is the text of the functions that
`shadow_map.glsl` lists, or a file beside it.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import Changes, Clock
from shadowbench.gl.device import Device, moderngl
from shadowbench.gl.gbuffer import GBuffer
from shadowbench.plugin.contact import Contact, ContactPass, NoContact
from shadowbench.plugin.history import History, HistoryPass, NoHistory
from shadowbench.plugin.params import SubjectParams, components_of, param
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.model import Camera, Light, LightKind, View


@dataclass(frozen=True)
class Phase:
    """Subtexel offset of a map's texel grid against the scene; phase 0 is the fit's own position."""

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
    """The inputs of one draw. `index` counts draws; at 0, what `stage.remembered` keeps of earlier ones is invalid."""

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
        """Uniform `light` of receiver.glsl: unit vector towards a directional light, w = 0, or a position, w = 1."""
        xyz, w = self.light.homogeneous
        return (*xyz, w)

    def timed(self, name: str, changes: Changes = "frame") -> AbstractContextManager[None]:
        """Context manager that times a pass.

        changes: what invalidates its result: "light" motion, "view" (camera or light motion), or every "frame".
        """
        return self.clock.timed(name, changes)


@dataclass(frozen=True)
class Entry:
    """What others need to know of a technique: `recommend`, the documentation, the keys of rows and the tests.

    picture_scene: the built-in scene that its documentation pictures, empty for the first that it draws. grid:
    parameter values that `recommend` tries, by name, besides map sizes, while others stay at their defaults; soft_grid:
    in place of some of these where the light has a size; never_recommended: why `recommend` never chooses it.
    soft_only: whether it is another technique where the light has no size; only_planes: whether non-planar receivers
    stay lit; steady: parameters besides by which shadows stay in place as the camera moves, tried where flicker is
    limited; exact: whether visibility follows from the geometry alone, not from a texel grid or a fitted box.
    builds_on: other techniques whose code or shaders it uses; variants: parameters, in spec syntax, of the specs that
    the laws of shadows are tested with.
    """

    picture_scene: str = ""
    grid: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    soft_grid: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    never_recommended: str = ""
    soft_only: bool = False
    only_planes: bool = False
    steady: Mapping[str, Any] = field(default_factory=dict)
    exact: bool = False
    builds_on: Sequence[type["Technique"]] = ()
    variants: Sequence[str] = ("",)


def surface_of(technique: "Technique", surface: GBuffer) -> GBuffer:
    """What a technique receives shadows on: the triangles, or the smooth surfaces that they stand for."""
    return surface.lifted if technique.lifts(technique.params) else surface


class Subject(ABC):
    """What a spec names and a study measures: a technique of ours, or another engine. Its docstring documents it."""

    name: ClassVar[str]
    Params: ClassVar[type[SubjectParams]] = SubjectParams
    presets: ClassVar[dict[str, str]] = {}  # parameters in spec syntax, by preset name
    lights: ClassVar[frozenset[LightKind]] = frozenset({"directional", "spot", "point"})  # supported light kinds
    own: ClassVar[bool] = True  # whether it is drawn here, and timed; an engine is neither
    phased: ClassVar[bool] = False  # whether it has a texel grid that a phase can shift
    catalogue: ClassVar[Entry] = Entry()

    @classmethod
    def map_size(cls, params: Any) -> int | None:
        """Texels along a side of the map; None for one without a map."""
        return getattr(params, "size", None)

    @classmethod
    def view_slices(cls, params: Any) -> int:
        """Number of frustum slices with a map of their own."""
        return 1

    @classmethod
    def extra_work(cls, params: Any) -> str | None:
        """Why these parameters have no cost where specs are ranked by counts of work; None if they have."""
        return None

    @classmethod
    def lifts(cls, params: Any) -> bool:
        """Whether shadows are received on the smooth surface, not on its triangles."""
        return any(component.lifts for component in components_of(params))

    @classmethod
    def draws_on_cpu(cls, params: Any) -> bool:
        """Whether the CPU does part of the drawing: timed by the wall clock on every device, not by the GPU's timer."""
        return False


class TechniqueParams(SubjectParams):
    """Base class of every technique's parameters."""

    contact: Contact = param(NoContact(), "contact shadows on top")
    history: History = param(NoHistory(), "what earlier frames add")


class Technique(Subject):
    """A way to compute visibility. A subclass with a `name` is registered; its docstring is its documentation."""

    Params: ClassVar[type[TechniqueParams]] = TechniqueParams

    params: TechniqueParams

    def __init__(self, params: Any) -> None:
        self.params = params

    @classmethod
    def unsupported(cls, params: Any, view: View, device: Device) -> str | None:
        """Why these parameters cannot draw this view on this device; None if they can."""
        return None

    @classmethod
    def declines(cls, params: Any, view: View, device: Device) -> str | None:
        """Why the technique cannot draw this view, by `unsupported` or `lights`; None if it can."""
        kind = view.light.hard_kind
        if kind not in cls.lights:
            answers = f"a {kind} light; {cls.name} answers {' and '.join(sorted(cls.lights))} ones"
            return cls.unsupported(params, view, device) or answers
        if params.history.of_texels and cls.confidence is Technique.confidence:
            return f"history={params.history.name} needs a shadow map's texels, which {cls.name} has not"
        return cls.unsupported(params, view, device)

    @abstractmethod
    def build(self, stage: Stage) -> None:
        """Create programs, textures and buffers, independent of the camera's and the light's pose."""

    @abstractmethod
    def draw(self, frame: Frame) -> moderngl.Texture:
        """Visibility of every pixel: one float component, size × size, 1 where no receiver is visible."""

    def map_image(self) -> NDArray[np.float32] | None:
        """The map of the last draw, (H, W) linear depth in [0, 1], row 0 at the top; None for techniques without."""
        return None

    def tint(self) -> moderngl.Texture | None:
        """Debug colours of the last draw, linear RGBA of the image's size; None if the technique has none.

        Rendered only when called. A debug picture multiplies the shaded surfaces by them.
        """
        return None

    def confidence(self) -> moderngl.Texture:
        """How near each pixel's point is to the centre of its texel in the map of the last draw, from 1 there to 0.

        Drawn only when called. Of a technique that has one, for a history of texels.
        """
        raise NotImplementedError(self.name)

    def facts(self) -> dict[str, float]:
        """Statistics of the last draw for its row, such as a bias in metres.

        `reads` (texture reads) and `rays` count as work.
        """
        return {}


def build(technique: Technique, stage: Stage) -> Callable[[Frame], moderngl.Texture]:
    """Build a technique. Returns its `draw`, with the contact shadows and the history of its parameters on top."""
    technique.build(stage)
    draw: Callable[[Frame], moderngl.Texture] = technique.draw
    if technique.params.contact.shader:
        draw = ContactPass(stage, technique, draw)
    return HistoryPass(stage, technique, draw) if technique.params.history.shader else draw


__all__ = ["Changes", "Entry", "Frame", "Phase", "Stage", "Technique", "TechniqueParams", "param"]
