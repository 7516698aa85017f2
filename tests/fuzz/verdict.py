"""The outcome of shadowbench for one case, observed in the same process: a result, a one-line error, or a failure.

With an ear for every file and socket opened, and a limit of the address space.
"""

import os
import resource
import shutil
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import psutil

from shadowbench.errors import InputError
from shadowbench.plugin.registry import techniques
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.library import load_scene
from shadowbench.scenes.model import view_of
from shadowbench.studies.study import read_study

from .cases import ASSETS, INSIDE, OUTSIDE, ROOT, Case

MOST_MEMORY = 4 << 30
"""Bytes of address space that reading a file may take."""
LONGEST_LINE = 3000
"""Characters of a refusal: it must be read by somebody."""
FORBIDDEN = ("socket.connect", "socket.bind", "socket.getaddrinfo", "os.system", "os.remove", "os.rename", "os.mkdir",
             "os.symlink", "os.truncate", "shutil.rmtree", "urllib.Request")  # fmt: skip


class Verdict(NamedTuple):
    """A verdict. kind: result, refusal or failure; line: the message; small: a result that can be drawn quickly."""

    kind: str
    line: str
    small: bool = True


class Watch:
    """Records files that are opened outside the allowed folders while a case is read."""

    def __init__(self) -> None:
        self.allowed: tuple[str, ...] = ()
        self.seen: list[str] = []
        self.on = False
        sys.addaudithook(self.hear)

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path = os.path.realpath(os.fsdecode(arguments[0]))
            written = bool(arguments[2] & (os.O_WRONLY | os.O_RDWR)) if isinstance(arguments[2], int) else False
            if (written and path != os.devnull) or not path.startswith(self.allowed):
                self.seen.append(f"{'wrote' if written else 'read'} {path}")
        elif event in FORBIDDEN:
            self.seen.append(f"{event} {arguments!r:.100}")

    @contextmanager
    def over(self, *folders: Path) -> Iterator[None]:
        own = [os.path.realpath(sys.prefix), os.path.realpath(sys.base_prefix),
               str(ROOT / "shadowbench"), str(ROOT / "scenes"), str(ROOT / "benchmarks"),
               os.devnull, "/proc/self", f"/proc/{os.getpid()}", "/sys/", "/etc/localtime", "/usr/"]  # fmt: skip
        self.allowed = (*own, *(str(folder.resolve()) for folder in folders))
        self.seen.clear()
        self.on = True
        try:
            yield
        finally:
            self.on = False


@contextmanager
def limited_memory() -> Iterator[None]:
    """Lets this process take MOST_MEMORY more."""
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (psutil.Process().memory_info().vms + MOST_MEMORY, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def tree(root: Path) -> dict[str, Any]:
    """Size and modification time of every file below a folder, or the target of a link."""
    found = {}
    for path in root.rglob("*"):
        facts = path.lstat()
        found[str(path.relative_to(root))] = (facts.st_mode, facts.st_size if path.is_file() else 0, facts.st_mtime_ns)
    return found


def judged(case: Case, watch: Watch) -> Verdict:
    """The verdict on one case."""
    root = Path(tempfile.mkdtemp(prefix="fuzz-"))
    try:
        main = case.write(root)
        before = tree(root)
        # A study names scenes anywhere, as the command line does; a scene may not look beyond its folder.
        beyond = [root / OUTSIDE] if case.kind == "study" else []
        with warnings.catch_warnings(), limited_memory(), watch.over(root / INSIDE, root / ASSETS, *beyond):
            warnings.simplefilter("error")
            verdict = _of(lambda: READ[case.kind](case, main, root / ASSETS))
        if watch.seen:
            return Verdict("failure", f"{watch.seen[0]}; then {verdict.kind} {verdict.line}".replace(str(root), "."))
        if tree(root) != before:
            return Verdict("failure", "something was written beside the file")
        return verdict
    finally:
        shutil.rmtree(root, ignore_errors=True)


def _of(read: Callable[[], bool]) -> Verdict:
    try:
        small = read()
    except InputError as error:
        line = str(error)
        if _memory_ran_out(error):
            return Verdict("failure", f"memory: {line}")
        if len(line.splitlines()) != 1 or not line.isprintable():
            return Verdict("failure", f"not one line: {line!r:.300}")
        if len(line) > LONGEST_LINE:
            return Verdict("failure", f"a line of {len(line)} characters: {line:.300}")
        return Verdict("refusal", line)
    except BaseException as error:  # whatever it is, it is what the fuzzer looks for
        import traceback

        last = traceback.extract_tb(error.__traceback__)[-1]
        return Verdict("failure", f"{type(error).__name__}: {error!s:.200} ({Path(last.filename).name}:{last.lineno})")
    return Verdict("result", "", small)


def _memory_ran_out(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _scene(case: Case, main: Path, assets: Path) -> bool:
    scene = load_scene(main, assets)
    assert scene.meshes and scene.cameras and scene.lights
    geometry = scene.geometry
    assert np.isfinite(geometry.vertices).all()
    assert geometry.faces.min() >= 0 and geometry.faces.max() < len(geometry.vertices)
    view, _ = view_of(scene, scene.cameras[0], scene.lights[0], 16).placed()
    assert np.isfinite(view.scene.geometry.vertices).all()
    assert np.isfinite([*view.near_far, *view.camera.position]).all()
    return len(geometry.faces) < 100_000


def _study(case: Case, main: Path, assets: Path) -> bool:
    study = read_study(main, techniques())
    cells = study.cells()
    block = next(study.blocks())
    blocks = len(study.scenes) * len(study.views) * len(study.lights_of(block.view.scene))
    few = blocks * len(cells) <= 8 and len(block.view.scene.geometry.faces) < 100_000
    return few and max(cell.spec.map_size or 0 for cell in cells) <= 1024


def _spec(case: Case, main: Path, assets: Path) -> bool:
    spec = parse_spec(case.text, techniques())
    assert parse_spec(spec.full_text, techniques()) == spec
    return (spec.map_size or 0) <= 1024


READ = {
    "scene": _scene,
    "study": _study,
    "spec": _spec,
    **dict.fromkeys(("glb", "gltf", "obj", "ply", "stl", "off"), _scene),
}
