"""The outcome of a command for one case, observed from outside: exit code, output and files."""

import subprocess
import sys
import tempfile
from pathlib import Path

from .cases import ASSETS, INSIDE, Case
from .verdict import Verdict, tree

PATIENCE = 120.0
"""Seconds in all: other programs may want the same cores."""


def commanded(case: Case) -> Verdict:
    """The verdict on a command: `truth` for a scene or mesh, `run` for a study or spec."""
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        root = Path(folder)
        main, out = case.write(root), root / "out"
        out.mkdir()
        assets = ("--assets", str(root / ASSETS))
        words = ["truth", str(main), "--pixel-samples", "1", *assets, "-o", str(out / "a.npz")]
        if case.kind == "study":
            words = ["run", "-s", str(main), "--rounds", "0", *assets, "-o", str(out / "run")]
        if case.kind == "spec":
            spec = case.text.replace("\0", "")
            words = ["run", "cube-on-plane", "-t", spec, "--rounds", "0", "-o", str(out / "run")]
        before = tree(root)
        done = subprocess.run(
            [sys.executable, "-m", "shadowbench", *words, "--view-size", "16"],
            cwd=root / INSIDE, capture_output=True, timeout=PATIENCE, check=False,
        )  # fmt: skip
        return answer(done.returncode, done.stderr.decode(errors="replace").splitlines(), before, tree(root))


def answer(code: int, said: list[str], before: dict[str, object], after: dict[str, object]) -> Verdict:
    """The verdict on an exit code, the lines of stderr, and the files before and after."""
    line = said[-1] if said else ""
    lines = [text for text in said if not text.startswith("note: ")]  # what was assumed until then
    written = sorted(after.keys() - before.keys())
    changed = sorted(name for name in before if name != "out" and after.get(name) != before[name])
    stray = [name for name in written if not name.startswith("out") or Path(name).name.startswith(".")]
    problems = {
        f"exit code {code}": code not in (0, 2),
        "a traceback or a warning": any("Traceback" in text or "Warning" in text for text in said),
        f"not one line of ours, the last: {lines}": code == 2 and (lines != [line] or line[:13] != "shadowbench: "),
        f"changed {changed[:3]}": bool(changed),
        f"wrote {stray[:3]}": bool(stray),
        f"left {written[:3]}": code == 2 and bool(written),
        f"wrote only {written[:3]}": code == 0 and not any(one.endswith(("a.npz", "table.csv")) for one in written),
    }
    for what, wrong in problems.items():
        if wrong:
            return Verdict("failure", f"command: {what}: {' / '.join(said[-3:]):.500}")
    return Verdict("result" if code == 0 else "refusal", line)
