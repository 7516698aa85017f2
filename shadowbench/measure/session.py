"""What draws and times cells, as plain calls: it holds the GL context.

The worker process serves these over a pipe; benchmarks call them in their own process.
"""

import gc
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import moderngl
import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import quoted
from shadowbench.gl.clock import Clock, PassTimes, Sample, with_cost, work_of
from shadowbench.gl.device import Device, open_device
from shadowbench.gl.gbuffer import download
from shadowbench.measure.cells import CellRequest, PlacedView
from shadowbench.measure.loaded import Built, LoadedScene, OpenView
from shadowbench.measure.profile import Profile
from shadowbench.measure.rendering import Rendering, numbers, own_work
from shadowbench.scores.masks import quantise
from shadowbench.techniques.base import Frame, Phase, Stage, Technique
from shadowbench.techniques.registry import shader_folder, techniques
from shadowbench.techniques.spec import Spec, parse_spec
from shadowbench.techniques.stage import ShaderText

WARM_UP = 2  # draws of a cell that are thrown away


@dataclass(frozen=True)
class DeviceInfo:
    """What the parent needs to know of the worker's device."""

    renderer: str
    vendor: str
    version: int
    software: bool
    clock: str
    max_map_size: int
    subpixel_bits: int
    pipeline_statistics: bool
    clip_control: bool


class Unsupported(Exception):
    """A technique cannot answer a view; the text, one line, says why."""

    def __init__(self, reason: str) -> None:
        super().__init__(quoted(reason))


class Session:
    """One device. The scene and the view that it was asked about last stay on it, until it is asked about others."""

    def __init__(self, plugins: Sequence[Path] = ()) -> None:
        self.techniques = techniques(plugins)
        self.device: Device = open_device()
        self.clock = Clock(self.device)
        self.profile = Profile()
        self._loaded: LoadedScene | None = None
        self._opened: OpenView | None = None
        self._kept: dict[CellRequest, Built] = {}  # of the open view, not yet held
        self._held: list[Built] = []

    def info(self) -> DeviceInfo:
        """The device and the clock that times it."""
        device = self.device
        return DeviceInfo(
            renderer=device.renderer,
            vendor=device.vendor,
            version=device.version,
            software=device.software,
            clock=self.clock.name,
            max_map_size=device.max_map_size,
            subpixel_bits=device.subpixel_bits,
            pipeline_statistics=device.pipeline_statistics,
            clip_control=device.clip_control,
        )

    def spent(self) -> dict[str, float]:
        """Seconds by activity since the start."""
        return dict(self.profile.seconds)

    def open(self, at: PlacedView) -> None:
        """Load a view's scene and draw its G-buffer, where that is not done; whatever is asked of a view does so."""
        self._open(at)

    def surface(self, at: PlacedView) -> NDArray[np.int32]:
        """The (N, N) triangle ids of a view's G-buffer, row 0 at the top."""
        opened = self._open(at)
        with self.profile.of("read back"):
            return opened.surface.triangles()

    def shading(self, at: PlacedView) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
        """A view's picture lit everywhere, and in shadow everywhere, (N, N, 3) uint8 sRGB."""
        opened = self._open(at)
        with self._passes():
            return opened.loaded.picture_pass.extremes(opened.surface, opened.view)

    def unload(self) -> None:
        """Free the view and the scene."""
        self._close()
        if self._loaded is not None:
            self._loaded.release()
            self._loaded = None

    def _load(self, at: PlacedView) -> LoadedScene:
        if self._loaded is None or not self._loaded.shows(at):
            self.unload()
            with self.profile.of("build"):
                self._loaded = LoadedScene(self.device, at.view.scene, at.coordinates)
        return self._loaded

    def _open(self, at: PlacedView) -> OpenView:
        if self._opened is None or not self._opened.shows(at):
            self._close()
            loaded = self._load(at)
            view = loaded.placed(at.view)
            self._tidy()
            with self._passes():
                self._opened = OpenView(at.view, loaded, view, loaded.surface_pass.draw(view))
        return self._opened

    def _close(self) -> None:
        """Free the view, and what is kept and held of its cells."""
        self.let_go()
        while self._kept:
            self._kept.popitem()[1].stage.release()
        if self._opened is not None:
            self._opened.surface.release()
            self._opened = None

    def unsupported(self, at: PlacedView, request: CellRequest) -> str | None:
        """Why a cell has no answer for a view, or None."""
        reason = self._declined(self._open(at), self._spec(request))
        return None if reason is None else quoted(reason)

    def build(self, at: PlacedView, request: CellRequest) -> None:
        """Build a cell of a view, and keep it for `draw` and `hold`; raises as `draw` does."""
        opened = self._open(at)
        if request not in self._kept:
            self._kept[request] = self._build(opened, request)

    def shaders(self, at: PlacedView, request: CellRequest) -> list[ShaderText]:
        """The GLSL of a cell as the driver is given it, every include and define in it; raises as `draw` does."""
        stage = self._build(self._open(at), request).stage
        stage.release()
        return stage.texts

    def draw(
        self, at: PlacedView, request: CellRequest, with_map: bool = False, tinted: bool = False, keep: int = 0
    ) -> Rendering:
        """Build unless it is kept, draw once, read back, release. Raises Unsupported, or whatever the technique raises.

        `tinted` multiplies the technique's own colours into the picture, where it has any. It is kept for `hold`
        instead, as long as all that is kept for this view takes no more than `keep` bytes.
        """
        opened = self._open(at)
        built = self._kept.pop(request, None) or self._build(opened, request)
        try:
            drawn = self._drawn(opened, request, built, with_map, tinted)
        except BaseException:
            built.stage.release()
            raise
        if sum(other.stage.bytes for other in self._kept.values()) + built.stage.bytes <= keep:
            self._kept[request] = built
        else:
            built.stage.release()
        return drawn

    def _drawn(self, opened: OpenView, request: CellRequest, built: Built, with_map: bool, tinted: bool) -> Rendering:
        technique, frame, view = built.technique, built.frame, opened.view
        self._tidy()
        with self._passes():
            texture = technique.draw(frame)
        self._tidy()
        self.device.check(f"drawing {request.spec}")
        self._check(request, texture, view.size)
        with self.profile.of("read back"):
            visibility = self._read(request, download(texture)[..., 0])
        with self._passes():
            tint = technique.tint() if tinted else None
            picture = opened.loaded.picture_pass.draw(frame.surface, view, texture, tint)
        depths = technique.map_image() if with_map else None
        facts = numbers(request.spec, technique.facts())
        with self._passes():
            # The same frame, index 0, so that the work is that of the frame which is scored: history stays void.
            work = work_of(self.device, lambda: technique.draw(frame))
        work = with_cost(work | own_work(technique, view.size**2, facts))
        return Rendering(visibility, picture, depths, built.stage.bytes, work, facts)

    def hold(self, at: PlacedView, request: CellRequest) -> float:
        """Hold a cell for timing, as it was kept or built anew, warmed up; the milliseconds that building it took."""
        opened = self._open(at)
        built = self._kept.pop(request, None) or self._build(opened, request)
        self._held.append(built)
        for _ in range(WARM_UP):
            self._tidy()
            with self._passes():
                self._next_draw(-1)()
        self.device.check(f"warming up {request.spec}")
        return built.prepare_ms

    def time_frame(self, held: int) -> Sample:
        """What a whole frame took of the cell that was held as number `held`, from 0."""
        with self._undisturbed(held) as draw:
            return self.clock.frame(draw)

    def time_passes(self, held: int) -> PassTimes:
        """Milliseconds of the passes of one frame of a held cell."""
        with self._undisturbed(held) as draw:
            return self.clock.passes(draw)

    def let_go(self) -> None:
        """Release what is held."""
        while self._held:
            self._held.pop().stage.release()

    def _next_draw(self, held: int) -> Callable[[], object]:
        """The next draw of a held cell; the frames of its draws are counted up from index 0, the first after build."""
        built = self._held[held]
        self._held[held] = replace(built, frame=replace(built.frame, index=built.frame.index + 1))
        return partial(built.technique.draw, built.frame)

    @contextmanager
    def _undisturbed(self, held: int) -> Iterator[Callable[[], object]]:
        """The next draw of a held cell, without the garbage collector and without another cell's state."""
        draw = self._next_draw(held)
        self._tidy()
        gc.disable()
        try:
            with self._passes():
                yield draw
        finally:
            gc.enable()
        self.device.check("timing")

    @contextmanager
    def _passes(self) -> Iterator[None]:
        """Draws, of which none is left for another activity to wait for."""
        with self.profile.of("passes"):
            yield
            self.device.context.finish()

    def _spec(self, request: CellRequest) -> Spec:
        return parse_spec(request.spec, self.techniques)

    def _declined(self, opened: OpenView, spec: Spec) -> str | None:
        return spec.technique.declines(spec.params, opened.view, self.device)

    def _tidy(self) -> None:
        """Put back what a technique's raw calls may have left, so that it costs no other cell its values."""
        self.device.context.enable_only(moderngl.NOTHING)
        self.device.context.wireframe = False

    def _check(self, request: CellRequest, texture: object, size: int) -> None:
        """Raise TypeError or ValueError for what is no texture of the view's size."""
        if not isinstance(texture, moderngl.Texture):
            raise TypeError(f"{request.spec} drew {type(texture).__name__}; allowed: a texture")
        if texture.size != (size, size):
            width, height = texture.size
            raise ValueError(f"{request.spec} drew {width} × {height} pixels; allowed: {size} × {size}")
        if texture.components != 1:
            raise ValueError(f"{request.spec} drew {texture.components} components; allowed: 1, the visibility")

    def _read(self, request: CellRequest, raw: NDArray[np.generic]) -> NDArray[np.float32]:
        try:
            return quantise(raw)
        except ValueError as error:
            raise ValueError(f"{request.spec} drew {error}") from error

    def _build(self, opened: OpenView, request: CellRequest) -> Built:
        start = time.perf_counter()
        with self.profile.of("prepare"):
            technique, stage, frame = self._assembled(opened, request)
            self.device.context.finish()
        return Built(technique, stage, frame, (time.perf_counter() - start) * 1e3)

    def _assembled(self, opened: OpenView, request: CellRequest) -> tuple[Technique, Stage, Frame]:
        spec = self._spec(request)
        reason = self._declined(opened, spec)
        if reason is not None:
            raise Unsupported(reason)
        loaded, view = opened.loaded, opened.view
        size, folder = (view.size, view.size), shader_folder(spec.technique)
        stage = Stage(loaded.scene, self.device, size, loaded.geometry, loaded.placement, folder)
        technique = spec.technique(spec.params)
        try:
            technique.build(stage)
            self.device.check(f"building {request.spec}")
        except BaseException:
            stage.release()
            raise
        return technique, stage, Frame(view, Phase(request.phase), 0, opened.surface, self.clock)
