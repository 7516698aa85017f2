"""Fixtures shared by all tests: larger scenes, a truth cache, the GL device and views drawn on it."""

import hashlib
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

from shadowbench.api import score
from shadowbench.commands import main
from shadowbench.geometry.facing import cap_weights, wall_weights
from shadowbench.geometry.vertex_order import by_first_use, in_reuse_order
from shadowbench.gl.device import Device, Releasable, open_device
from shadowbench.gl.gbuffer import DeviceGeometry, GBuffer, GBufferPass, download
from shadowbench.measure import gl_drawer, machine, worker
from shadowbench.measure.worker import Limits, Worker
from shadowbench.options import ViewSizeLike
from shadowbench.plugin.registry import forget_components
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import Mesh, Placement, Scene, View, view_of
from shadowbench.scenes.opening import chosen_view
from shadowbench.scenes.shapes import build_shape
from shadowbench.truths.trace import Truth, trace

pytest_plugins = ["tests.runs", "tests.drawing"]

# A suite that a script starts in the background ignores SIGINT, and so would the programs that tests interrupt.
signal.signal(signal.SIGINT, signal.default_int_handler)

if settings.get_current_profile_name() == "default":  # not CI's
    settings.register_profile("suite", deadline=None, max_examples=50)  # a busy machine is no failure
    settings.load_profile("suite")


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile loops after a change: neither the note of it nor the cache's folder is in what tests look at."""
    if not hasattr(session.config, "workerinput"):
        gl_drawer.compile_beside()
        for scene in ("post", "sphere-and-torus"):  # a soft truth, and a hard one, grazing light among it
            truth = trace(chosen_view(scene, 16), 1)
            score(truth.visibility, truth)
        geometry = truth.view.scene.geometry
        by_first_use(geometry.faces[in_reuse_order(geometry.faces)])
        edges, light = np.zeros((0, 4), np.int64), np.zeros(4)
        cap_weights(geometry.vertices, edges[:, :3].copy(), light, 0, 0)
        wall_weights(geometry.vertices, edges, light, 0, 0)


@pytest.fixture(scope="session")
def shared_scenes() -> Path:
    """Folder of larger scenes, which are not in the repository."""
    root = Path(__file__).resolve().parents[1]
    folder = root / os.environ.get("SHADOWBENCH_SCENES", "../shared/scenes")
    if not folder.is_dir():
        pytest.skip(f"no larger scenes in {folder}; SHADOWBENCH_SCENES names their folder")
    return folder


@pytest.fixture(scope="session", autouse=True)
def truth_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A truth cache for this session, shared by all xdist processes, unless SHADOWBENCH_CACHE names one."""
    folder = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        folder = folder.parent
    with pytest.MonkeyPatch.context() as patch:
        if "SHADOWBENCH_CACHE" not in os.environ:
            patch.setenv("SHADOWBENCH_CACHE", str(folder / "truth-cache"))
        yield


@pytest.fixture(autouse=True)
def only_own_components() -> Iterator[None]:
    """No filter of a plug-in outlives its test."""
    yield
    forget_components()


@pytest.fixture(scope="session")
def only_device() -> Device:
    """The context of this process. Tests use `device`, which makes it current."""
    return open_device()


@pytest.fixture
def device(only_device: Device) -> Iterator[Device]:
    """The GL device, without an error before the test and after it."""
    with only_device.context:
        only_device.check("whatever ran before this test")
        yield only_device
        only_device.check("this test")


@dataclass(eq=False)
class Shot:
    """A view with its G-buffer. view: in local coordinates; filed: in file coordinates; row 0 is at the top."""

    filed: View
    view: View
    placement: Placement
    geometry: DeviceGeometry
    surface: GBuffer

    @cached_property
    def position(self) -> np.ndarray:
        return download(self.surface.position).astype(np.float64)

    @cached_property
    def normal(self) -> np.ndarray:
        return download(self.surface.normal).astype(np.float64)

    @cached_property
    def triangle(self) -> np.ndarray:
        return self.surface.triangles()


class Studio:
    """Draws G-buffers of views; they are freed after the test."""

    def __init__(self, device: Device) -> None:
        self.device = device
        self._scenes: dict[Scene, tuple[Scene, DeviceGeometry, GBufferPass]] = {}
        self._held: list[Releasable] = []

    def shot(self, filed: View) -> Shot:
        """The G-buffer of a view in file coordinates; views of one scene share its geometry."""
        placement = filed.scene.placement
        if filed.scene not in self._scenes:
            scene = placement.scene(filed.scene)
            geometry = DeviceGeometry(self.device, scene.geometry)
            self._scenes[filed.scene] = scene, geometry, GBufferPass(self.device, geometry)
            self._held[:0] = [self._scenes[filed.scene][2], geometry]
        scene, geometry, surface_pass = self._scenes[filed.scene]
        view = View(scene, placement.camera(filed.camera), placement.light(filed.light), filed.size)
        surface = surface_pass.draw(view)
        self._held.insert(0, surface)
        return Shot(filed, view, placement, geometry, surface)

    def release(self) -> None:
        for thing in self._held:
            thing.release()


@pytest.fixture
def studio(device: Device) -> Iterator[Studio]:
    """Draws G-buffers of views."""
    studio = Studio(device)
    yield studio
    studio.release()


@pytest.fixture(scope="session")
def builtin() -> Callable[..., View]:
    """The first view of a built-in scene, each scene loaded once."""
    load = lru_cache(load_scene)

    def view(name: str, size: ViewSizeLike = 256) -> View:
        scene = load(name)
        return view_of(scene, scene.cameras[0], scene.lights[0], size)

    return view


@pytest.fixture(scope="session")
def truth_of(builtin: Callable[..., View]) -> Callable[..., Truth]:
    """The truth of the first view of a built-in scene, traced once."""
    return lru_cache(lambda name, size=256: trace(builtin(name, size), pixel_samples=1))


@pytest.fixture(scope="session")
def shape() -> Callable[..., Mesh]:
    """A named shape, scaled, then moved."""

    def make(
        kind: str,
        scale: float | Sequence[float] = 1.0,
        at: Sequence[float] = (0.0, 0.0, 0.0),
        casts: bool = True,
        receives: bool = True,
        **parameters: int,
    ) -> Mesh:
        triangles = build_shape(kind, parameters, "test")
        vertices = triangles.vertices * np.asarray(scale, dtype=np.float64) + np.asarray(at, dtype=np.float64)
        return Mesh(kind, vertices, triangles.faces, casts=casts, receives=receives)

    return make


@dataclass(frozen=True)
class Answer:
    """Result of a command: exit code, stdout and stderr."""

    code: int
    out: str
    err: str


def key_of(*parts: object) -> str:
    """A key with the format of row keys."""
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:24]


NOT_OF_WORKERS = {"PYTEST_CURRENT_TEST", "SHADOWBENCH_CACHE", "COLUMNS"}  # which read no truths and print no tables


@pytest.fixture(scope="session")
def lent_worker(plugin_folder: Path) -> Iterator[Callable[..., AbstractContextManager[Worker]]]:
    """In place of `Worker`: commands in the same environment are served by the same process.

    Another serves those with `half` or `wild`. Those with plug-ins of one test, whose files may change, have their own.
    """
    kept: dict[object, Worker] = {}
    with ExitStack() as session:

        @contextmanager
        def lent(plugins: Sequence[Path] = (), limits: Limits | None = None) -> Iterator[Worker]:
            if any(plugin.parent != plugin_folder for plugin in plugins):
                with Worker(plugins, limits) as own:
                    yield own
                return
            environment = frozenset(item for item in os.environ.items() if item[0] not in NOT_OF_WORKERS)
            key = bool(plugins), environment
            if key not in kept:
                kept[key] = session.enter_context(Worker(sorted(plugin_folder.glob("*.py")) if plugins else ()))
            kept[key].limits = limits or Limits()
            yield kept[key]

        yield lent


@pytest.fixture
def shadowbench(
    lent_worker: Callable[..., object], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., Answer]:
    """Calls the command line in this process; a worker's output is caught too."""
    for module in (worker, machine, gl_drawer):
        monkeypatch.setattr(module, "Worker", lent_worker)

    def call(*arguments: str | Path) -> Answer:
        monkeypatch.setattr(sys, "argv", ["shadowbench", *map(str, arguments)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        assert isinstance(stop.value.code, int)
        return Answer(stop.value.code, *capfd.readouterr())

    return call
