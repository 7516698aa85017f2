"""The outcome of a command for one case, observed from outside: exit code, output, files, memory and time."""

import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

from .cases import ASSETS, INSIDE, Case
from .verdict import MOST_MEMORY, Verdict, tree

PATIENCE = 120.0
"""Seconds in all: other programs may want the same cores."""

SMALL = ["--view-size", "16", "-o"]


def commanded(case: Case) -> Verdict:
    """The verdict on a command: `truth` for a scene or mesh, `run` for a study or spec."""
    root = Path(tempfile.mkdtemp(prefix="fuzz-"))
    try:
        main = case.write(root)
        out = root / "out"
        out.mkdir()
        before = tree(root)
        code, said, memory, took = _run(_arguments(case, main, root), root)
        after = tree(root)
        return answer(code, said, memory, took, before, after)
    finally:
        shutil.rmtree(root, ignore_errors=True)


def _arguments(case: Case, main: Path, root: Path) -> list[str]:
    if case.kind == "study":
        return [
            "run",
            "-s",
            str(main),
            "--rounds",
            "0",
            "--assets",
            str(root / ASSETS),
            *SMALL,
            str(root / "out" / "run"),
        ]
    if case.kind == "spec":
        return [
            "run",
            "cube-on-plane",
            "-t",
            case.text.replace("\0", ""),
            "--rounds",
            "0",
            *SMALL,
            str(root / "out" / "run"),
        ]
    return [
        "truth",
        str(main),
        "--pixel-samples",
        "1",
        "--assets",
        str(root / ASSETS),
        *SMALL,
        str(root / "out" / "a.npz"),
    ]


def _run(arguments: list[str], root: Path) -> tuple[int, list[str], int, float]:
    """Exit code, lines of stderr, most bytes resident with all children, and seconds."""
    start, most = time.monotonic(), 0
    with (root / "stderr").open("wb") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "shadowbench", *arguments],
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            cwd=root / INSIDE,
        )
        watched = psutil.Process(process.pid)
        while process.poll() is None and time.monotonic() - start < PATIENCE:
            most = max(most, _resident(watched))
            time.sleep(0.05)
        took = time.monotonic() - start
        if process.poll() is None:
            for child in [*watched.children(recursive=True), watched]:
                child.kill()
        process.wait()
    lines = (root / "stderr").read_text(encoding="utf-8", errors="replace").splitlines()
    (root / "stderr").unlink()
    return process.returncode, lines, most, took


def _resident(process: psutil.Process) -> int:
    try:
        return sum(one.memory_info().rss for one in [process, *process.children(recursive=True)])
    except psutil.NoSuchProcess:
        return 0


def answer(
    code: int, said: list[str], memory: int, took: float, before: dict[str, object], after: dict[str, object]
) -> Verdict:
    """The verdict on an exit code, the lines of stderr, bytes, seconds, and the files before and after."""
    line = said[-1] if said else ""
    lines = [text for text in said if not text.startswith("note: ")]  # what was assumed until then
    written = sorted(after.keys() - before.keys())
    changed = sorted(name for name in before if name != "out" and after.get(name) != before[name])
    problems = [
        (took >= PATIENCE, f"hung: more than {PATIENCE:.0f} s"),
        (memory > MOST_MEMORY, f"{memory / 2**30:.1f} GiB resident"),
        (code not in (0, 2), f"exit code {code}"),
        (any("Traceback" in text or "Warning" in text for text in said), "a traceback or a warning"),
        (code == 2 and len(lines) != 1, f"{len(lines)} lines beside notes"),
        (code == 2 and said[-1:] != lines[-1:], "a note after the error"),
        (code == 2 and not line.startswith("shadowbench: "), "no line of ours"),
        (bool(changed), f"changed {changed[:3]}"),
        (any(not name.startswith("out") for name in written), f"wrote {written[:3]}"),
        (code == 2 and bool(written), f"left {written[:3]}"),
        (code == 0 and not any(name.endswith(("a.npz", "table.csv")) for name in written), f"wrote only {written[:3]}"),
        (any(Path(name).name.startswith(".") for name in written), f"half-written {written[:3]}"),
    ]
    for wrong, what in problems:
        if wrong:
            return Verdict("failure", f"command: {what}: {' / '.join(said[-3:]):.500}")
    return Verdict("result" if code == 0 else "refusal", line)
