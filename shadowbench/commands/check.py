"""`check`: compare a run with a baseline; `--update` makes the run the baseline."""

import json as json_module
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from shadowbench.commands import console, options
from shadowbench.errors import InputError, alternatives, counted
from shadowbench.options import option

if TYPE_CHECKING:
    from shadowbench.results.baseline import Findings


@dataclass(frozen=True)
class CheckOptions:
    """What a run is compared with, and how strictly."""

    baseline: Path | None = option("The baseline, or another run folder, to compare with.", "DIR")
    time: bool = options.flag("Also fail if a cell is slower, on the same machine.")
    update: bool = options.flag("Make this run the baseline, and print the changes.")
    masks: bool = options.flag("With --update: keep the masks too, so that pictures show them beside later ones.")
    github: bool = options.flag(
        "Also print errors as annotations of a GitHub workflow, and append the summary to $GITHUB_STEP_SUMMARY."
    )
    tolerance: list[str] = option(
        "Tolerance of a metric, instead of its default; repeatable  [see `shadowbench list metrics`].",
        "METRIC=X",
        default=(),
    )
    plugin: list[Path] = options.plugins()


@options.command(
    "\b\nFor example\n"
    "  shadowbench check results/latest --baseline results/baseline\n"
    "  shadowbench check results/latest --baseline results/baseline --update"
)
def check(
    folder: Annotated[Path, options.argument("DIR", "The run folder to check.")],
    asked: CheckOptions,
    json: options.Json = False,
    quiet: options.Quiet = False,
) -> int:
    """Fail if a run is worse than a baseline.

    Compares metrics, work and status of each cell with the baseline's cell of the same scene, view, light, phase, spec,
    map size and view size. Exit code 1 if a cell regressed or is missing, 2 if run and baseline share no cell.
    If one regressed, DIR/check has summary.md, summary.json, and pictures of the worst cells: the truth, the mask
    before, if the baseline keeps it, and now, with the place that became worst enlarged.

    Work is compared on the same renderer only: draws, primitives, texture reads, rays and GPU memory exactly, shader
    invocations within 2%. Times are compared on the same machine only, as ratios to the reference.

    \b
    Columns
      what         the metric, work counter or `status` that changed most, or of acne, leak and contact that
                   which takes the largest share of its region, if it changed and is 1% or more
      × tolerance  the change as a multiple of the tolerance
      also         the other values of the cell that changed
    """
    from shadowbench.files import make_folder, replace_file
    from shadowbench.measure.plugin_output import techniques_with
    from shadowbench.reports.regressions import annotations, markdown, write_pictures
    from shadowbench.results.baseline import check as compared
    from shadowbench.results.baseline import write_baseline
    from shadowbench.studies.study import copy_study

    techniques_with(asked.plugin)  # whose metrics are compared too
    if asked.baseline is None:
        raise InputError("check: found no --baseline; allowed: --baseline DIR")
    if asked.github and json:
        raise InputError("--github: found with --json; allowed: one of them, DIR/check/summary.json has the same")
    if asked.masks and not asked.update:
        raise InputError("--masks: found without --update; allowed: with it")
    tolerances = _tolerances(asked.tolerance)
    findings, run, baseline = compared(folder, asked.baseline, tolerances, asked.time, asked.update)
    failed = bool(findings.of("regressed") or (asked.time and findings.of("slower"))) and not asked.update
    files, pictures, last = folder / "check", dict[str, Path](), ""
    for stale in [] if asked.update else [*files.glob("*.png"), *files.glob("summary.*")]:
        stale.unlink()
    if failed and baseline is not None:
        make_folder(files)
        pictures = write_pictures(findings, run, baseline, files)
        last = f"{files}: summary.md, summary.json, {counted(len(pictures), 'picture')}"
    values, summary = findings.json(pictures), markdown(findings, asked.baseline, folder, pictures, asked.time)
    if failed:
        text = json_module.dumps(values, indent=2, allow_nan=False, default=str)
        for name, content in (("summary.md", summary), ("summary.json", f"{text}\n")):
            with replace_file(files / name) as temporary:
                temporary.write_text(content, encoding="utf-8", errors="replace")
    if json:
        console.print_json(values)
    else:
        _print(findings, asked.baseline, asked.time)
    if asked.update:
        write_baseline(run.results, asked.baseline, run.folder / "masks" if asked.masks else None)
        study = copy_study(run.about, folder, asked.baseline)
        last = f"{asked.baseline / 'rows.jsonl'}: {counted(len(run.results), 'cell')}, the baseline from now on"
        last += f"; study.toml is a copy of {study}" if study else ""
    elif asked.github:
        for line in annotations(findings, pictures, asked.time):
            console.print_line(line)
        if step_summary := os.environ.get("GITHUB_STEP_SUMMARY"):
            with Path(step_summary).open("a", encoding="utf-8", errors="replace") as file:
                file.write(summary)
    for note in () if quiet else findings.notes:
        console.print_error(f"note: {note}")
    if last and not json and not quiet:
        console.print_line(last)
    return int(failed)


def _tolerances(texts: Sequence[str]) -> dict[str, float]:
    """METRIC=X by metric; raises InputError for an unknown metric or an invalid tolerance."""
    from shadowbench.measure.columns import ROW_METRICS

    tolerances = {}
    for text in texts:
        name, _, value = text.partition("=")
        if name not in ROW_METRICS:
            known = alternatives(name, ROW_METRICS, "allowed: METRIC=X, METRIC one of")
            raise InputError(f"--tolerance: found {text!r:.60}{known}")
        try:
            tolerances[name] = float(value)
        except ValueError:
            tolerances[name] = math.nan
        if not 0 <= tolerances[name] < math.inf:
            raise InputError(f"--tolerance {name}: found {value!r:.40}; allowed: a number, 0 or more")
    return tolerances


def _print(findings: "Findings", baseline: Path, time: bool) -> None:
    """A table of changes of each kind, and a summary."""
    from shadowbench.reports.regressions import COLUMNS, LINES, counts, tables

    for title, rows in tables(findings, time):
        numbers = ("map", "before", "", "after", "× tolerance")
        console.print_table(title, COLUMNS, rows[:LINES], numbers=numbers, whole=("what",))
        if len(rows) > LINES:
            console.print_line(f"  and {len(rows) - LINES} more; --json lists all")
        console.print_text("")
    if findings.compared or findings.changes:
        console.print_line(counts(findings, baseline))
