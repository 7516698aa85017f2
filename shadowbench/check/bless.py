"""Making a run the baseline: copies its rows and its study file."""

import json
import shlex
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.measure.rows import SCHEMA, Result, RunFile
from shadowbench.scores.metrics import is_soft
from shadowbench.studies.crossing import Techniques
from shadowbench.studies.study import find_study, read_study


def write_baseline(results: Sequence[Result], folder: Path) -> None:
    """Write a baseline's `rows.jsonl` atomically: score records, then time records.

    Raises InputError if there is no cell, if a cell failed, and if the folder cannot be written.
    """
    if not results:
        raise InputError("--update: found no cell; allowed: a run whose last command measured one or more")
    failed = [result for result in results if result.status.startswith("failed")]
    if failed:
        first = f"{failed[0].score['scene']} {failed[0].score['spec']}: {failed[0].status}"
        raise InputError(
            f"--update: found {len(failed)} cells that failed, the first {first}; allowed: a run without failed cells"
        )
    # The command line is left out: it may name local paths, and comparisons do not use it.
    scores = [{name: value for name, value in result.score.items() if name != "command"} for result in results]
    records = [*scores, *(result.time for result in results if result.time)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror or error})") from None
    with replace_file(folder / "rows.jsonl") as temporary:
        lines = (json.dumps({"schema": SCHEMA, **record}, allow_nan=False) + "\n" for record in records)
        temporary.write_text("".join(lines), encoding="utf-8")


def copy_study(about: RunFile, results: Sequence[Result], folder: Path, techniques: Techniques) -> Path | None:
    """Copy the study file named by a run's command to `study.toml` in a folder; about: the run's `run.json`.

    Returns the copied file; None if the command names none, if it is gone or copied already, or if the copy would not
    produce the run's cells, because of relative scene paths or other options of the command.
    """
    try:
        words = shlex.split(about.get("command", "").replace("--study=", "--study "))
    except ValueError:  # an unbalanced quote: not a command line of ours
        return None
    named = [value for option, value in pairwise(words) if option in ("-s", "--study")]
    if not named:
        return None
    file, kept = find_study(named[-1]), folder / "study.toml"
    if not file.is_file() or (kept.exists() and kept.samefile(file)) or not _makes(file, folder, results, techniques):
        return None
    with replace_file(kept) as temporary:
        temporary.write_bytes(file.read_bytes())
    return file


def _makes(file: Path, folder: Path, results: Sequence[Result], techniques: Techniques) -> bool:
    try:
        study, moved = read_study(file, techniques), read_study(file, techniques, folder)
    except InputError:  # changed since, or needs a plug-in
        return False
    rows = [result.score for result in results]
    soft = any(is_soft(row.get("metrics", {})) for row in rows)
    cells = {(cell.spec.full_text, cell.phase) for cell in moved.cells(soft)}
    return (
        moved.scenes == study.scenes
        and len(moved.scenes) == len({row["scene"] for row in rows})
        and cells == {(row["full_spec"], row["phase"]) for row in rows}
        and {moved.view_size} == {row["view_size"] for row in rows}
        and {moved.step} >= {row.get("step") for row in rows if row["status"] == "ok"}
    )
