"""What an engine declares, to be measured like a technique: data alone. Its `draw.js` or `draw.py` draws.

The declaration is a class in a package, as `shadowbench/engines/NAME/`, beside a lock file: `package-lock.json` of npm
with `package.json`, or `requirements.txt` of pip, each with hashes and without addresses. Its parameters at their
defaults are the settings that the engine ships with. `draw.js` exports, and `draw.py` defines, three functions:

    open(canvas and size, or size)          the engine's version; in Python its version and the name of the renderer
    load(model, view)                       a scene in place of the former: in Python the path of a .glb, on a page its
                                            bytes, `glb`; and the object of view.json
    draw(camera, light, box, params, shadows, exposure)
                                            a complete picture of that scene, with or without shadows

`camera` and `light` are those of view.json, which in a sequence move from frame to frame; the scene is loaded again
only if its surfaces move. `nearest` is the least of all frames. `light` is without its box, of intensity `exposure`: a
white surface that faces it is as bright as `exposure`, at full from 1. `box` is what the shadow map is to cover: of a
directional light position, target and up of an orthographic camera, width, height and depth, which begins at 0; of
others near and far. `params` has the parameters.
Pictures are without ambient light, tone mapping, dithering, anti-aliasing and background. In Python they are returned:
(H, W, 3 or 4), uint8 or float32, row 0 at the top; on a page they are what the canvas shows.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import ClassVar, Literal

from shadowbench.plugin.base import Subject
from shadowbench.plugin.params import SubjectParams, param
from shadowbench.scenes.model import View

Sides = Literal["closed", "double"]


class EngineParams(SubjectParams):
    """Parameters of every engine."""

    sides: Sides = param("closed", "which materials are double-sided: those of meshes that are not closed, or all")


class Engine(Subject):
    """Another renderer, which draws in a program of its own. An entry point registers it.

    package: its name in the lock file; host: the program that draws: a page in headless Chromium, or Python; python:
    its version; imports, scripts: the page's import map and classic scripts, as paths in its packages; display: whether
    it draws in a window; vulkan: whether by Vulkan; box: whether the map's box is given or the engine's own; encoding:
    of pictures; casts: whether single meshes can be kept from casting and receiving; sources: where the settings of
    presets are from, and those that are shipped; seconds: limit of a call.
    """

    own = False
    Params: ClassVar[type[SubjectParams]] = EngineParams
    package: ClassVar[str]
    host: ClassVar[Literal["web", "python"]]
    python: ClassVar[str] = ""
    imports: ClassVar[Mapping[str, str]] = {}
    scripts: ClassVar[Sequence[str]] = ()
    display: ClassVar[bool] = False
    vulkan: ClassVar[bool] = False
    box: ClassVar[Literal["given", "own"]] = "own"
    encoding: ClassVar[Literal["srgb", "linear"]] = "srgb"
    casts: ClassVar[bool] = False
    sources: ClassVar[Mapping[str, str]] = {}
    seconds: ClassVar[float] = 120.0

    @classmethod
    def folder(cls) -> Path:
        """The folder of its files."""
        import inspect

        return Path(inspect.getfile(cls)).parent

    @classmethod
    def unsupported(cls, view: View) -> str | None:
        """Why it cannot draw a view; None if it can."""
        kind = view.light.hard_kind
        if kind not in cls.lights:
            return f"a {kind} light; {cls.name} draws {' and '.join(sorted(cls.lights))} ones"
        if not cls.casts and not all(mesh.casts and mesh.receives for mesh in view.scene.meshes):
            return "meshes that cast or receive no shadow"
        return None
