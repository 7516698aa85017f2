"""Cells drawn by other engines, each in a program of its own; all others are passed on."""

import hashlib
from collections.abc import Iterator, Mapping
from functools import cache
from types import TracebackType
from typing import TYPE_CHECKING, Self, cast

from shadowbench.engines.programs import HERE, browser_version, environment, what_lacks
from shadowbench.errors import InputError, Unsupported
from shadowbench.geometry.topology import is_closed, surrounds
from shadowbench.measure.campaign import Block, Cell
from shadowbench.measure.gl_drawer import GLDrawer
from shadowbench.measure.pictures import Rendering
from shadowbench.options import ViewSize
from shadowbench.plugin.base import Phase
from shadowbench.plugin.engine import Engine, EngineParams
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import View
from shadowbench.versions import ENGINES

if TYPE_CHECKING:
    from shadowbench.engines.engine_session import EngineSession

_MOST_OPEN = 2  # programs, of hundreds of MB each; a page of an engine that is drawn with others is opened again
_MOST_BYTES = 1 << 30  # memory of an engine that is started anew: some keep what each picture took, and grow slow


class EngineDrawer(GLDrawer):
    """Drawer of engines beside the techniques of `own`. A context manager, within which their programs run on.

    Engines are not timed: a picture's time is that of their host.
    """

    def __init__(self, own: GLDrawer) -> None:
        super().__init__(own.worker)
        self._sessions: dict[type[Engine], EngineSession] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for engine in list(self._sessions):
            self._close(engine)

    def identity(self, cell: Cell) -> Mapping[str, str]:
        """See `GLDrawer`. Of an engine also what is installed, our files and declaration of it, and the browser."""
        engine, own = engine_of(cell.spec), self.device_identity
        return own if engine is None else {**own, "engine": environment(engine).name, "adapter": _adapter(engine)}

    def draw(self, block: Block, cell: Cell, keep: bool = False) -> Iterator[Rendering]:
        """See `GLDrawer`. Raises InputError for an engine that is not installed."""
        engine = engine_of(cell.spec)
        if engine is None:
            yield from super().draw(block, cell, keep)
            return
        if reason := next(filter(None, (_unsupported(engine, view, cell) for view in block.views)), None):
            raise Unsupported(reason)
        session = self._session(engine, block.view.size)
        frames = session.draw(block.views, cast(EngineParams, cell.spec.params), Phase(cell.phase))
        for _ in block.views:
            try:
                drawn = next(frames)
            except BaseException:  # such as KeyboardInterrupt: no program may be left
                self._close(engine)
                raise
            yield drawn

    def _session(self, engine: type[Engine], size: ViewSize) -> "EngineSession":
        """The engine's program; one that has ended, draws another size or is large is replaced."""
        open_one = self._sessions.get(engine)
        if open_one and (open_one.host.ended or open_one.size != size or open_one.host.memory > _MOST_BYTES):
            self._close(engine)
        if engine not in self._sessions:
            while len(self._sessions) >= _MOST_OPEN:
                self._close(next(iter(self._sessions)))
            from shadowbench.engines.engine_session import EngineSession  # imports trimesh, 0.8 s

            self._sessions[engine] = EngineSession(engine, size)
        self._sessions[engine] = self._sessions.pop(engine)  # behind those that were used before
        return self._sessions[engine]

    def _close(self, engine: type[Engine]) -> None:
        self._sessions.pop(engine).close()


def engine_of(spec: Spec) -> type[Engine] | None:
    """The engine of a spec; None for a technique. Raises InputError for one that cannot draw here."""
    if not issubclass(spec.technique, Engine):
        return None
    if lacking := what_lacks(spec.technique):
        raise InputError(f"{spec.technique.name}: {lacking}")
    return spec.technique


def _unsupported(engine: type[Engine], view: View, cell: Cell) -> str | None:
    """Why an engine cannot draw a cell; None if it can."""
    if (reason := engine.unsupported(view)) or cast(EngineParams, cell.spec.params).sides == "double":
        return reason
    for mesh in view.scene.meshes:
        if surrounds(mesh, view.camera.position) and is_closed(mesh):
            return f"the camera is inside {mesh.name}, of which only the outside is drawn; sides=double draws both"
    return None


@cache
def _adapter(engine: type[Engine]) -> str:
    """Digest of what draws: the engine's file and that of its host, what it declares of them, and the browser."""
    declared = engine.host, engine.imports, engine.scripts, engine.box, engine.encoding, engine.phased, ENGINES
    browser = browser_version() if engine.host == "web" else ""
    drawing = sorted(file for file in engine.folder().iterdir() if file.stem == "draw")
    files = [*drawing, HERE / "python_host.py", HERE / "web_host.js"]
    parts = repr((declared, browser)).encode(), *(file.read_bytes() for file in files)
    return hashlib.sha256(b"".join(parts)).hexdigest()[:12]
