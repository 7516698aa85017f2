"""Drawing and timing of cells as plain calls, by the owner of the GL context.

The worker process serves these calls over a pipe; the benchmarks make them in their own process.
"""

import gc
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import Unsupported
from shadowbench.gl.clock import Clock, PassTimes, Sample, with_cost, with_work
from shadowbench.gl.device import Device, moderngl, open_device
from shadowbench.gl.gbuffer import DeviceGeometry, FacetPass, GBuffer, GBufferPass, download
from shadowbench.gl.picture import PicturePass
from shadowbench.gl.program import arithmetic
from shadowbench.maps.filters import Filter
from shadowbench.measure.pictures import Rendering, Surface
from shadowbench.measure.rows import renderer_of
from shadowbench.measure.worker import DeviceInfo
from shadowbench.options import ViewSize
from shadowbench.plugin.base import Frame, Phase, Stage, Technique, build, surface_of
from shadowbench.plugin.registry import shader_folder, techniques
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.plugin.stage import Memory, ShaderText
from shadowbench.scenes.model import IDENTITY_PLACEMENT, Coordinates, Placement, Scene, View
from shadowbench.scores.masks import quantise

Draw = Callable[[Frame], moderngl.Texture]


def checked_texture(spec: str, texture: object, size: ViewSize) -> moderngl.Texture:
    """What a technique drew. TypeError or ValueError unless it is a texture of the view's size, with one component."""
    if not isinstance(texture, moderngl.Texture):
        raise TypeError(f"{spec} drew {type(texture).__name__}; allowed: a texture")
    if texture.size != size:
        drew, allowed = (" × ".join(map(str, sides)) for sides in (texture.size, size))
        raise ValueError(f"{spec} drew {drew} pixels; allowed: {allowed}")
    if texture.components != 1:
        raise ValueError(f"{spec} drew {texture.components} components; allowed: 1, the visibility")
    return texture


def visibility_of(spec: str, texture: object, size: ViewSize) -> NDArray[np.float32]:
    """(height, width) quantised visibility that a technique drew, row 0 at the top.

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
    if more := technique.params.contact.reads + technique.params.history.reads:
        work["reads"] = work.get("reads", 0) + pixels * more
    return work


def finite_facts(spec: str, facts: Mapping[str, float]) -> dict[str, float]:
    """Facts as plain floats. Raises ValueError if one is not finite."""
    for name, value in facts.items():
        if not math.isfinite(value):
            raise ValueError(f"{spec}: fact {name!r} is {value}; allowed: finite numbers")
    return {name: float(value) for name, value in facts.items()}


class LoadedScene:
    """A scene on the GPU: its buffers and passes, in the coordinates in which it is drawn."""

    def __init__(self, device: Device, file_scene: Scene, placement: Placement) -> None:
        self.device, self.file_scene, self.placement = device, file_scene, placement
        self.scene = placement.scene(file_scene)
        self.geometry = DeviceGeometry(device, self.scene.geometry)
        self.surface_pass = GBufferPass(device, self.geometry)
        self.picture_pass = PicturePass(device, self.geometry)
        self.facet_pass = FacetPass(device, self.geometry) if self.scene.geometry.smooth else None

    def matches(self, scene: Scene, placement: Placement) -> bool:
        """Whether it is a scene in these coordinates."""
        return scene is self.file_scene and placement == self.placement

    def to_drawing_coordinates(self, view: View) -> View:
        """A view of this scene converted from file coordinates (near and far planes known) to drawing coordinates."""
        return View(self.scene, self.placement.camera(view.camera), self.placement.light(view.light), view.size)

    def darken_facets(self, spec: str, technique: Technique, texture: object, surface: GBuffer, view: View) -> None:
        """Make what a technique drew 0 where triangles hide from the light what the smooth surface shows it.

        surface: with the triangles. Not if the technique lifts its receivers. Raises as `checked_texture` does.
        """
        if self.facet_pass is not None and not technique.lifts(technique.params):
            self.facet_pass.draw(checked_texture(spec, texture, view.size), surface, view)

    def build(
        self, spec: Spec, size: ViewSize, room: int = sys.maxsize, memory: Memory | None = None
    ) -> tuple[Technique, Stage, Draw]:
        """A technique built for images of a size, and what draws it. Raises any exception of the technique.

        room: most bytes that its textures and buffers may take, beyond which Unsupported is raised; memory: what it
        remembers of frames with earlier geometry, which is freed with it or if it fails.
        """
        folder = shader_folder(spec.drawn_here)
        stage = Stage(self.scene, self.device, size, self.geometry, self.placement, folder, room, memory)
        technique = spec.drawn_here(spec.params)
        try:
            draw = build(technique, stage)
            self.device.check(f"building {spec.full_text}")
        except BaseException:
            stage.release()
            raise
        return technique, stage, draw

    def release(self) -> None:
        """Free GPU memory."""
        self.picture_pass.release()
        if self.facet_pass is not None:
            self.facet_pass.release()
        self.surface_pass.release()
        self.geometry.release()


WARM_UP = 2  # untimed draws before a cell is timed, of which the one that is scored may be the first
RISE_S = 0.5  # an H100 that was idle drew at a quarter of its rate


@dataclass(frozen=True)
class CellRequest:
    """A cell as sent to another process: its full spec as text, its phase, and the coordinates it is drawn in.

    room: most bytes that its textures and buffers may take, beyond which it is unsupported.
    """

    spec: str
    phase: int = 0
    coordinates: Coordinates = "relative"
    room: int = sys.maxsize


@dataclass(frozen=True, eq=False)
class _OpenView:
    """A view with its G-buffer: `file_view` in file coordinates, `view` in drawing coordinates."""

    file_view: View
    loaded: LoadedScene
    view: View
    surface: GBuffer

    def matches(self, other: View, placement: Placement) -> bool:
        """Whether this is the given view."""
        own = self.file_view
        same = (own.camera, own.light, own.size) == (other.camera, other.light, other.size)
        return same and self.loaded.matches(other.scene, placement)


@dataclass(frozen=True, eq=False)
class _BuiltCell:
    """A technique built for a scene and an image size, and ready to draw; prepare_ms: its build time."""

    technique: Technique
    stage: Stage
    draw: Draw
    prepare_ms: float


@dataclass(frozen=True, eq=False)
class _Drawn:
    """The cell that was drawn last, and the index of its frame. keep: as in `draw`, 0 unless `build` built it."""

    request: CellRequest
    built: _BuiltCell
    index: int
    keep: int


@cache
def load_for_builds() -> None:
    """Import what building a technique imports, and compile or load its loops, for which no timed build then waits."""
    import scipy.sparse.csgraph
    import scipy.spatial  # noqa: F401

    from shadowbench.geometry import facing  # noqa: F401
    from shadowbench.geometry.tree import build_tree
    from shadowbench.geometry.vertex_order import by_first_use, in_reuse_order
    from shadowbench.truths.embree import Tracer

    corners, faces = np.eye(3), np.arange(3, dtype=np.int32).reshape(1, 3)
    by_first_use(faces[in_reuse_order(faces)])
    build_tree(corners, faces)
    Tracer(corners, faces)


def compile_loops() -> None:
    """Compile half of the loops of a first truth, score and build: call them on next to nothing, longest first.

    `python -m shadowbench.measure.session` does so beside the first command, since Numba compiles on one core.
    """
    from shadowbench.scores import loops
    from shadowbench.scores.comparison import C1, C2, WEIGHTS
    from shadowbench.truths.hard import find_nearest
    from shadowbench.truths.packets import cutout_arrays

    none, vectors, index = np.zeros(0), np.zeros((3, 0)), np.zeros(0, np.intp)
    tree = np.zeros((1, 4), np.uint32), np.zeros(3), np.ones(3)
    casters = np.zeros((0, 3)), np.zeros((0, 3), np.int32), index, cutout_arrays(None, 0)
    own = index, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(3)
    find_nearest(*tree, *casters, vectors, vectors, none, *own, none, np.zeros(0, np.bool_))
    image, pixels = np.zeros((1, 1), np.float32), np.ones((1, 1), np.bool_)
    loops.ssim_map(image, image, pixels, WEIGHTS, C1, C2)
    loops.squared_distance(pixels)
    load_for_builds()


class Session:
    """An OpenGL device that draws cells. The last scene and view stay loaded until a call names others.

    Cells stay built while scene, coordinates and image size do: those kept for timing, and the one that was drawn last,
    for the next frame of a sequence.
    """

    def __init__(self, plugins: Sequence[Path] = ()) -> None:
        self.techniques = techniques(plugins)
        self.device = open_device()
        self.clock = Clock(self.device)
        self._loaded: LoadedScene | None = None
        self._open_view: _OpenView | None = None
        self._kept: dict[CellRequest, _BuiltCell] = {}  # for a later draw or timing
        self._last: _Drawn | None = None
        self._timed: list[tuple[_BuiltCell, Frame]] = []

    def info(self) -> DeviceInfo:
        """Facts about the device and its clock."""
        device = self.device
        return DeviceInfo(
            renderer=renderer_of(device.renderer, arithmetic(device) if device.software else None),
            vendor=str(device.context.info["GL_VENDOR"]),
            version=device.version,
            software=device.software,
            clock=self.clock.name,
            max_map_size=device.max_map_size,
            subpixel_bits=device.subpixel_bits,
            pipeline_statistics=device.pipeline_statistics,
            clip_control=device.clip_control,
        )

    def surface(self, view: View, coordinates: Coordinates = "relative") -> Surface:
        """What masks of a view are drawn over."""
        opened = self._ensure_open(view, coordinates)
        return Surface(opened.surface.triangles(), *opened.loaded.picture_pass.extremes(opened.surface, opened.view))

    def unload(self) -> None:
        """Free the view and its scene, with all cells built for it."""
        self._close_view()
        self._free_cells()
        if self._loaded is not None:
            self._loaded.release()
            self._loaded = None

    def _ensure_open(self, view: View, coordinates: Coordinates, index: int = 0) -> _OpenView:
        """The view, open. index: after frame 0, the cell that was drawn last goes on, with what it remembers."""
        placement = view.scene.placement if coordinates == "relative" else IDENTITY_PLACEMENT
        if index and self._last and self._last.built.stage.memory.values:  # which is in the coordinates of frame 0
            placement = self._last.built.stage.placement
        if self._open_view is None or not self._open_view.matches(view, placement):
            if self._open_view and self._open_view.view.size != view.size:
                self._free_cells()
            self._close_view()
            if self._loaded is None or not self._loaded.matches(view.scene, placement):
                last, self._last = (self._last, None) if index else (None, self._last)
                self.unload()
                if last:
                    last.built.stage.release(but_memory=True)
                self._last, self._loaded = last, LoadedScene(self.device, view.scene, placement)
            drawn = self._loaded.to_drawing_coordinates(view)
            self.device.reset()
            self._open_view = _OpenView(view, self._loaded, drawn, self._loaded.surface_pass.draw(drawn))
        return self._open_view

    def _close_view(self) -> None:
        """Free the view, and the cells whose timing was prepared."""
        self.release_timed()
        if self._open_view is not None:
            self._open_view.surface.release()
            self._open_view = None

    def _free_cells(self) -> None:
        """Free all cells that may be drawn or timed later."""
        if self._last:
            self._last.built.stage.release()
            self._last = None
        while self._kept:
            self._kept.popitem()[1].stage.release()

    def _settle(self) -> None:
        """Keep the cell that was drawn last if it is to be timed and there is room, else free it."""
        if self._last:
            (last, self._last), kept = (self._last, None), self._kept.values()
            if sum(other.stage.bytes for other in kept) + last.built.stage.bytes <= last.keep:
                self._kept[last.request] = last.built
            else:
                last.built.stage.release()

    def shaders(self, view: View, request: CellRequest) -> list[ShaderText]:
        """GLSL of a cell as passed to the driver, with all includes and defines resolved. Raises as `draw` does."""
        stage = self._build(self._ensure_open(view, request.coordinates), request).stage
        stage.release()
        return stage.texts

    def build(self, view: View, request: CellRequest) -> None:
        """Build a cell that will be drawn and then timed, as its build is. Raises as `draw` does."""
        load_for_builds()
        self._settle()
        open_view = self._ensure_open(view, request.coordinates)
        if request not in self._kept:
            self._kept[request] = self._build(open_view, request)

    def draw(
        self,
        view: View,
        request: CellRequest,
        with_map: bool = False,
        tinted: bool = False,
        keep: int = 0,
        index: int = 0,
    ) -> Rendering:
        """Draw a cell once and read the images back. Raises Unsupported, or any exception of the technique.

        tinted: multiply the technique's debug colours, if any, into the picture; keep: a cell of `build` stays for
        `prepare_timing` if all kept cells together take at most this many bytes, else it is released. index: of the
        frame in a sequence; the cell remembers the frames before, which must be the last that were drawn, and at 0
        nothing. Raises ValueError otherwise. What remembers is drawn in the local coordinates of frame 0.
        """
        last = self._last
        if index == 0:
            self._settle()
        elif not last or (last.request, last.index + 1, last.built.stage.size) != (request, index, view.size):
            before = f"frame {last.index} of {last.request.spec}" if last else "nothing"
            raise ValueError(f"frame {index} of {request.spec} after {before}; allowed: the frame after that, or 0")
        try:
            open_view = self._ensure_open(view, request.coordinates, index)
            self._last = self._next(open_view, request, index, keep)
            return self._draw_built(open_view, self._last, with_map, tinted)
        except BaseException:
            if self._last:
                self._last.built.stage.release()
                self._last = None
            raise

    def _next(self, open_view: _OpenView, request: CellRequest, index: int, keep: int) -> _Drawn:
        """A frame that is to be drawn, by the cell that was drawn last if it goes on and its scene stays."""
        if index == 0 or not self._last:
            kept = self._kept.pop(request, None)
            return _Drawn(request, kept or self._build(open_view, request), 0, keep if kept else 0)
        built = self._last.built
        if built.stage.scene is not open_view.view.scene:
            built = self._build(open_view, request, built.stage.memory)
        return replace(self._last, built=built, index=index)

    def _draw_built(self, open_view: _OpenView, drawn: _Drawn, with_map: bool, tinted: bool) -> Rendering:
        technique, view, spec = drawn.built.technique, open_view.view, drawn.request.spec
        self._check_supported(technique, technique.params, view)
        frame = self._frame(open_view, drawn.request, technique, drawn.index)
        self.device.reset()
        texture, work = with_work(self.device, lambda: drawn.built.draw(frame))
        self.device.reset()
        self.device.check(f"drawing {spec}")
        open_view.loaded.darken_facets(spec, technique, texture, open_view.surface, view)
        visibility = visibility_of(spec, texture, view.size)
        tint = technique.tint() if tinted else None
        picture = open_view.loaded.picture_pass.draw(open_view.surface, view, texture, tint)
        depths = technique.map_image() if with_map else None
        facts = finite_facts(spec, technique.facts())
        work = with_cost(work | declared_work(technique, view.size.pixels, facts))
        return Rendering(visibility, picture, depths, drawn.built.stage.bytes, work, facts)

    def prepare_timing(self, view: View, request: CellRequest) -> float:
        """Prepare a cell for timing: build it unless kept, and warm it up. Returns its build time in milliseconds."""
        load_for_builds()
        self._settle()
        open_view = self._ensure_open(view, request.coordinates)
        kept = self._kept.pop(request, None)
        built = kept or self._build(open_view, request)
        self._timed.append((built, self._frame(open_view, request, built.technique, 0)))
        for _ in range(WARM_UP - 1 if kept else WARM_UP):
            self.device.reset()
            self._next_draw(-1)()
            self.device.context.finish()
        self.device.check(f"warming up {request.spec}")
        return built.prepare_ms

    def raise_clocks(self) -> None:
        """Draw the prepared cells in turn for a while, in which a GPU raises its clock rates, if it is one."""
        start = time.perf_counter()
        while not self.device.software and time.perf_counter() < start + RISE_S:
            for index in range(len(self._timed)):
                self.device.reset()
                self._next_draw(index)()
            self.device.context.finish()
        self.device.check("raising the clock rates")

    def time_frame(self, index: int) -> Sample:
        """Time one whole frame of a cell; index: its position, from 0, in the order of `prepare_timing` calls."""
        with self._isolated_draw(index) as draw:
            return self.clock.frame(draw, self._draws_on_cpu(index))

    def time_passes(self, index: int) -> PassTimes:
        """Time each pass of one frame of a cell, indexed as in `time_frame`."""
        with self._isolated_draw(index) as draw:
            return self.clock.passes(draw, self._draws_on_cpu(index))

    def _draws_on_cpu(self, index: int) -> bool:
        technique = self._timed[index][0].technique
        return technique.draws_on_cpu(technique.params)

    def release_timed(self) -> None:
        """Release all cells prepared for timing."""
        while self._timed:
            self._timed.pop()[0].stage.release()

    def _next_draw(self, index: int) -> Callable[[], object]:
        """The next draw call of a prepared cell. Frame indices count up from 0, the first draw after the build."""
        built, frame = self._timed[index]
        self._timed[index] = built, replace(frame, index=frame.index + 1)
        return partial(built.draw, frame)

    @contextmanager
    def _isolated_draw(self, index: int) -> Iterator[Callable[[], object]]:
        """The next draw call of a prepared cell, run without the garbage collector and with default GL state."""
        draw = self._next_draw(index)
        self.device.reset()
        gc.disable()
        try:
            yield draw
            self.device.context.finish()
        finally:
            gc.enable()
        self.device.check("timing")

    def _build(self, open_view: _OpenView, request: CellRequest, memory: Memory | None = None) -> _BuiltCell:
        self.device.context.finish()
        start = time.perf_counter()
        spec = parse_spec(request.spec, self.techniques)
        if (spec.map_size or 0) > self.device.max_map_size:
            raise Unsupported(
                f"map size {spec.map_size}: {self.info().renderer} allows 1 to {self.device.max_map_size}"
            )
        self._check_supported(spec.drawn_here, spec.params, open_view.view)
        technique, stage, draw = open_view.loaded.build(spec, open_view.view.size, request.room, memory)
        self.device.context.finish()
        return _BuiltCell(technique, stage, draw, (time.perf_counter() - start) * 1e3)

    def _check_supported(self, technique: Technique | type[Technique], params: object, view: View) -> None:
        if reason := technique.declines(params, view, self.device):
            raise Unsupported(reason)

    def _frame(self, open_view: _OpenView, request: CellRequest, technique: Technique, index: int) -> Frame:
        surface = surface_of(technique, open_view.surface)
        return Frame(open_view.view, Phase(request.phase), index, surface, self.clock)


if __name__ == "__main__":
    compile_loops()
