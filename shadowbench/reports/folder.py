"""Run folders as they are read: rows, what `run.json` says of them, and where the pictures are."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

from shadowbench.errors import InputError
from shadowbench.studies.baseline import identity
from shadowbench.studies.rows import SCHEMA, Record, row_of
from shadowbench.studies.runner import Result
from shadowbench.studies.tables import cells_frame


@dataclass(frozen=True, eq=False)
class Run:
    """One run folder. `label` names it in a report; `about` is its `run.json`, empty where there is none.

    `results` holds each cell once, as it was measured last; `older` counts the records that were measured again since,
    `foreign` the times of another machine than the last, which may not stand beside its.
    """

    label: str
    folder: Path
    about: Mapping[str, Any]
    results: tuple[Result, ...]
    older: int
    foreign: int

    @cached_property
    def frame(self) -> pd.DataFrame:
        """A line a cell, with the columns of `table.csv`, in the order of `results`."""
        return cells_frame(self.results)

    @property
    def renderer(self) -> str:
        """Who drew it: as `run.json` says, else the row that was measured last; `unknown` where neither does."""
        named = [result.score["renderer"] for result in self.results if result.score.get("renderer")]
        return str(self.about.get("device", {}).get("renderer") or (named[-1] if named else "unknown"))

    @property
    def software(self) -> bool | None:
        """Whether a processor drew it in place of a GPU; None where the folder does not say."""
        software = self.about.get("device", {}).get("software")
        return None if software is None else bool(software)

    @property
    def assumptions(self) -> list[str]:
        """Everything that was assumed, of the run and of every row, each once."""
        of_rows = [note for result in self.results for note in result.score.get("assumptions", ())]
        return list(dict.fromkeys([*self.about.get("assumptions", ()), *of_rows]))


def read_runs(folders: Sequence[Path]) -> list[Run]:
    """The run folders, labelled by name, or by path where names are the same; InputError for what is not one."""
    paths = list(dict.fromkeys(folder.resolve() for folder in folders))
    names = [path.name for path in paths]
    labels = [str(path) if names.count(path.name) > 1 else path.name for path in paths]
    return [_read_run(path, label) for path, label in zip(paths, labels, strict=True)]


def _read_run(folder: Path, label: str) -> Run:
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder; allowed: a folder that `shadowbench run` wrote")
    records = _records(folder / "rows.jsonl")
    scores = {record["key"]: record for record in records if record["kind"] == "score"}
    if not scores:
        raise InputError(f"{folder / 'rows.jsonl'}: found no cell; allowed: the rows of a run that measured something")
    times = [record for record in records if record["kind"] == "time"]
    machine = times[-1].get("machine") if times else None
    timed = {record["key"]: record for record in times if record.get("machine") == machine}
    latest = {identity(record): record for record in scores.values()}
    return Run(
        label=label,
        folder=folder,
        about=_about(folder / "run.json"),
        results=tuple(Result(score, timed.get(score["key"])) for score in latest.values()),
        older=len(scores) - len(latest),
        foreign=sum(record.get("machine") != machine for record in times),
    )


def _records(file: Path) -> list[Record]:
    """Every whole line; the last may have been cut short by the end of a run."""
    if not file.exists():
        raise InputError(f"{file.parent}: found no rows.jsonl; allowed: a folder that `shadowbench run` wrote")
    lines = file.read_bytes().split(b"\n")[:-1]
    return [_record(file, number, line) for number, line in enumerate(lines, start=1)]


def _record(file: Path, number: int, line: bytes) -> Record:
    record = row_of(line)
    if record is None or not (record["kind"] == "time" or {"scene", "spec", "status"} <= record.keys()):
        raise InputError(f"{file} line {number}: found something else; allowed: a row of schema {SCHEMA}")
    return record


def _about(file: Path) -> Mapping[str, Any]:
    if not file.exists():
        return {}
    try:
        about = json.loads(file.read_bytes())
    except ValueError:
        about = None
    if not isinstance(about, dict):
        raise InputError(f"{file}: found something else; allowed: the JSON object that `shadowbench run` writes")
    return about
