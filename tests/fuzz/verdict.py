"""The outcome of shadowbench for one case, observed in the same process: a result, a one-line error, or a failure.

With an ear for every file and socket opened, and a limit of the address space.
"""

import os
import re
import resource
import sys
import tempfile
import traceback
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
from shadowbench.truths.trace import trace

from .cases import ASSETS, INSIDE, OUTSIDE, ROOT, Case
from .corrupt import FORMATS

MOST_MEMORY = 4 << 30
"""Bytes of address space that reading a file may take."""
LONGEST_LINE = 3000
"""Characters of a refusal: it must be read by somebody."""
FORBIDDEN = re.compile(r"socket\.(connect|bind|getaddrinfo)|os\.(system|remove|rename|mkdir|symlink|truncate)|urllib.*")
COMPILED = re.compile(r"\b__pycache__\b|\.nb[ic]\b")
"""Files and folders of Python's and Numba's caches, made when a module is imported or a loop run for the first time."""


class Verdict(NamedTuple):
    """A verdict. kind: result, refusal or failure; line: the message."""

    kind: str
    line: str


class Watch:
    """Records files that are opened outside the allowed folders while a case is read."""

    def __init__(self) -> None:
        self.allowed: tuple[str, ...] = ()
        self.seen: list[str] = []
        self.on = False
        sys.addaudithook(self.hear)

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on or any(COMPILED.search(str(one)) for one in arguments):
            return
        if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
            path = os.path.realpath(os.fsdecode(arguments[0]))
            written = bool(arguments[2] & (os.O_WRONLY | os.O_RDWR)) if isinstance(arguments[2], int) else False
            if (written and path != os.devnull) or not path.startswith(self.allowed):
                self.seen.append(f"{'wrote' if written else 'read'} {path}")
        elif FORBIDDEN.fullmatch(event):
            self.seen.append(f"{event} {arguments!r:.100}")

    @contextmanager
    def over(self, *folders: Path) -> Iterator[None]:
        own = [sys.prefix, sys.base_prefix, *(ROOT / name for name in ("shadowbench", "scenes", "benchmarks"))]
        system = [os.devnull, "/proc/self", f"/proc/{os.getpid()}", "/sys/", "/etc/localtime", "/usr/"]
        self.allowed = (*system, *(os.path.realpath(folder) for folder in (*own, *folders)))
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
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        root = Path(folder)
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


def _of(read: Callable[[], None]) -> Verdict:
    try:
        read()
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
        last = traceback.extract_tb(error.__traceback__)[-1]
        return Verdict("failure", f"{type(error).__name__}: {error!s:.200} ({Path(last.filename).name}:{last.lineno})")
    return Verdict("result", "")


def _memory_ran_out(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, MemoryError):
            return True
        error = error.__cause__ or error.__context__
    return False


def _scene(case: Case, main: Path, assets: Path) -> None:
    """Loads a scene, and traces a small picture of it if it is not large."""
    scene = load_scene(main, assets)
    geometry = scene.geometry
    assert scene.meshes and np.isfinite(geometry.vertices).all()
    assert geometry.faces.min() >= 0 and geometry.faces.max() < len(geometry.vertices)
    view = view_of(scene, scene.cameras[0], scene.lights[0], 8)
    local, _ = view.placed()
    assert np.isfinite(local.scene.geometry.vertices).all()
    assert np.isfinite([*local.near_far, *local.camera.position]).all()
    if len(geometry.faces) < 10_000:
        assert np.isfinite(trace(view, 1).visibility).all()


def _study(case: Case, main: Path, assets: Path) -> None:
    study = read_study(main, techniques())
    assert study.cells() and next(study.blocks())


def _spec(case: Case, main: Path, assets: Path) -> None:
    spec = parse_spec(case.text, techniques())
    assert parse_spec(spec.full_text, techniques()) == spec


READ = {"study": _study, "spec": _spec, **dict.fromkeys(("scene", *FORMATS), _scene)}
