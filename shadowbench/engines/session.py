"""A running engine: its program, the scene that it holds, and masks drawn by it."""

import math
import subprocess
import tempfile
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.environment import browser, environment, python_of, software_renderer
from shadowbench.engines.export import describe, describe_light, glb_of
from shadowbench.engines.hosts import Host, HostFailed, PythonHost, WebHost
from shadowbench.engines.light_box import light_box
from shadowbench.engines.pictures import (
    BRIGHTER,
    Levels,
    Luminance,
    check_lit,
    encode_srgb,
    luminance,
    too_dark,
    visibility,
)
from shadowbench.engines.probe import check_probe, probe_view
from shadowbench.measure.session import Rendering
from shadowbench.measure.worker import CellFailed
from shadowbench.plugin.base import Phase
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.scenes.model import WIDEST_CONE, View
from shadowbench.truths.cache import cached_truth

_BRIGHTEST, _TOO_DARK, _CUT_OFF = 0.9, 0.5, 0.97  # luminance of the brightest surface: wanted, and where it is no good
_ROUNDING = 1e-5  # of floats, when a phase moves the light; a level of 8 bits is 30 times as much
_TRIES = 12  # pictures that may be drawn to find the exposure
_MOST_LEVELS, _TOO_DARK_SHARE = 4, 0.01  # exposures, and the share of surfaces that may be too dark in the brightest

Request = Mapping[str, Any]


class EngineSession:
    """A program in which an engine draws pictures of size² pixels; `close` ends it.

    Raises CellFailed if it cannot start, or draws a probe wrongly.
    """

    def __init__(self, engine: type[Engine], size: int) -> None:
        self.engine, self.size = engine, size
        self._stack = ExitStack()
        self._scene: tuple[View, str] | None = None
        try:
            self._host = self._start()
            told, _ = self._call("open", {"size": size})
            self.version, self.renderer = str(told["version"]), str(told["renderer"])
            if "SwiftShader" in self.renderer:
                raise CellFailed(
                    "drew with SwiftShader, whose 4 sub-pixel bits are not the 8 that undecided pixels assume"
                )
            probe = probe_view(size)
            check_probe(probe, self._lit_picture(probe, cast(EngineParams, engine.Params())))
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """End the program."""
        self._stack.close()

    @property
    def ended(self) -> bool:
        """Whether the program is no more, although nobody closed it."""
        return self._host.ended

    @property
    def memory(self) -> int:
        """Resident memory of the program's largest process, in bytes."""
        return self._host.memory

    def draw(self, view: View, params: EngineParams, phase: Phase) -> Rendering:
        """The mask of a view. Raises CellFailed; the session is to be closed then."""
        request = self._request(view, params, phase)
        if self._scene is None or self._scene[0] is not view or self._scene[1] != params.sides:
            self._lit = self._lit_levels(view, params)
        exposures = [BRIGHTER**level for level in range(len(self._lit))]
        shadowed = [self._picture(request, shadows=True, times=times) for times in exposures]
        again = self._picture(request, shadows=False)
        if np.abs(again - self._lit[0]).max() > _ROUNDING:
            raise CellFailed("drew two different pictures without shadows")
        mask, measurable = visibility(self._lit, shadowed)
        about = {"version": self.version, "renderer": self.renderer}
        about |= {"box": self.engine.box, "phase": "box" if self.engine.phased else "none"}
        picture = encode_srgb(shadowed[0])
        return Rendering(mask, picture, None, None, {}, {}, engine=about, measurable=measurable)

    def _lit_levels(self, view: View, params: EngineParams) -> Levels:
        """Pictures of a view without shadows, as many as its darkest surfaces need, at least two."""
        truth, request = cached_truth(view), self._request(view, params, Phase())
        levels = [self._lit_picture(view, params)]
        while len(levels) < 2 or (len(levels) < _MOST_LEVELS and too_dark(levels[-1], truth) > _TOO_DARK_SHARE):
            levels.append(self._picture(request, shadows=False, times=BRIGHTER ** len(levels)))
        check_lit(levels, truth, view.light.hard_kind == "directional")
        return levels

    def _lit_picture(self, view: View, params: EngineParams) -> Luminance:
        """Load a view, find the exposure at which its brightest surface is bright but not cut off, and draw that."""
        self._scene = None
        plain = plain_view(view)
        self._call("load", describe(plain, plain.scene.name), glb_of(plain, sides=params.sides))
        request = self._request(view, params, Phase())
        self._exposure = _BRIGHTEST
        for _ in range(_TRIES):
            picture = self._picture(request, shadows=False)
            brightest = float(np.quantile(picture, 0.999))
            if brightest > 0 and _TOO_DARK <= brightest < _CUT_OFF:
                self._scene = view, params.sides
                return picture
            self._exposure *= 0.25 if brightest >= _CUT_OFF else min(_BRIGHTEST / max(brightest, 1e-3), 100)
        raise CellFailed("drew no picture without shadows that is neither black nor white")

    def _request(self, view: View, params: EngineParams, phase: Phase) -> Request:
        """What the pictures of a cell have in common."""
        size, view = self.engine.map_size(params), plain_view(view)
        return {
            "light": describe_light(view.light),
            "box": light_box(view, size, phase.shift if self.engine.phased else (0.0, 0.0)),
            "params": params.model_dump(mode="json", exclude={"sides"}),
        }

    def _picture(self, request: Request, *, shadows: bool, times: float = 1.0) -> Luminance:
        """A picture, at a multiple of the view's exposure."""
        told, data = self._call("draw", {**request, "shadows": shadows, "exposure": times * self._exposure})
        picture: NDArray[Any] = np.frombuffer(data, told["type"]).reshape(told["shape"])
        return luminance(picture, self.engine, self.size)

    def _call(self, name: str, argument: Any, data: bytes = b"") -> tuple[dict[str, Any], bytes]:
        try:
            return self._host.call(name, argument, data, self.engine.seconds)
        except HostFailed as error:
            raise CellFailed(str(error)) from None

    def _start(self) -> Host:
        """Start the engine's program; what it prints goes to a file."""
        engine, folder = self.engine, environment(self.engine)
        log = Path(self._stack.enter_context(tempfile.TemporaryDirectory(prefix="shadowbench-"))) / "log"
        host: Host
        if engine.host == "web":
            packages = folder / "node_modules"
            drawing = engine.folder() / "draw.js"
            host = WebHost(browser(), drawing, packages, engine.imports, engine.scripts, log, software_renderer())
        else:
            variables = {**software_renderer(), "PYTHONPATH": ""}
            if engine.display:
                variables["DISPLAY"] = self._display()
            host = PythonHost(python_of(engine), engine.folder() / "draw.py", log, variables)
        self._stack.callback(host.close)
        return host

    def _display(self) -> str:
        """Name of a virtual display of its own."""
        command = ["Xvfb", "-displayfd", "1", "-screen", "0", "4096x4096x24", "-nolisten", "tcp", "-terminate"]
        server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        self._stack.enter_context(server)
        self._stack.callback(server.kill)
        assert server.stdout is not None
        return f":{server.stdout.readline().decode().strip()}"


@lru_cache(maxsize=1)  # a scene's geometry is made once
def plain_view(view: View) -> View:
    """A view as engines know it: of a disc or rectangle the spot in its place, and no two meshes of one name."""
    light, meshes = view.light, view.scene.meshes
    if light.kind != light.hard_kind:
        light = replace(light, kind=light.hard_kind, angle=math.radians(WIDEST_CONE))
    if len({mesh.name for mesh in meshes}) < len(meshes):  # by which some engines find what casts and receives
        meshes = tuple(replace(mesh, name=f"mesh {index}") for index, mesh in enumerate(meshes))
    if light is view.light and meshes is view.scene.meshes:
        return view
    return replace(view, scene=replace(view.scene, meshes=meshes), light=light)
