"""The study file of a run, copied to the baseline that the run becomes."""

import shlex
from itertools import pairwise
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.results.frame import Run
from shadowbench.scores.metrics import is_soft
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import find_study, read_study


def copy_study(run: Run, folder: Path, techniques: Techniques) -> Path | None:
    """Copy the study file named by a run's command to `study.toml` in a folder, and return the copied file.

    None if the command names none, if it is gone or copied already, or if the copy would not produce the run's cells,
    because of relative scene paths or other options of the command.
    """
    try:
        words = shlex.split(run.about.get("command", "").replace("--study=", "--study "))
    except ValueError:  # an unbalanced quote: not a command line of ours
        return None
    named = [value for option, value in pairwise(words) if option in ("-s", "--study")]
    if not named:
        return None
    file, kept = find_study(named[-1]), folder / "study.toml"
    if not file.is_file() or (kept.exists() and kept.samefile(file)) or not _makes(file, folder, run, techniques):
        return None
    with replace_file(kept) as temporary:
        temporary.write_bytes(file.read_bytes())
    return file


def _makes(file: Path, folder: Path, run: Run, techniques: Techniques) -> bool:
    """Whether a study file, moved to a folder, has the cells of a run."""
    try:
        study, moved = read_study(file, techniques), read_study(file, techniques, folder)
    except InputError:  # changed since, or needs a plug-in
        return False
    cells = {
        (cell.spec.full_text, cell.phase)
        for cell in moved.cells(any(is_soft(row.get("metrics", {})) for row in run.rows))
    }
    return (
        moved.scenes == study.scenes
        and len(moved.scenes) == len({row["scene"] for row in run.rows})
        and cells == {(row["full_spec"], row["phase"]) for row in run.rows}
        and {moved.view_size} == {row["view_size"] for row in run.rows}
        and {moved.step} >= {row.get("step") for row in run.rows if row["status"] == "ok"}
    )
