"""Merging of run folders, of several machines or of parts of a study, into one."""

import datetime
import json
import math
import os
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.errors import InputError, counted
from shadowbench.extremes.axes import AXES
from shadowbench.measure.flips import row_metrics
from shadowbench.measure.row_store import command_line, lock, read_run_file, stream_rows, unlock
from shadowbench.measure.rows import SCHEMA, Record, RunFile, StudyFacts, escaped
from shadowbench.results.frame import read_folders, read_sweep_positions, rows_file, write_cells, write_table
from shadowbench.results.ranges import operating_ranges, points_frame, ranges_frame
from shadowbench.scores.masks import mask_sha256, open_png, read_mask
from shadowbench.techniques.unshadowed import Unshadowed

_ROUNDING = 1e-9  # relative, or of 1 near 0; sums of floats differ with the width of a processor's vectors
_NEW = "allowed: a new folder, or an empty one"
_AGAIN = "repeat it, then merge again"


class _Score(NamedTuple):
    """A score row: its folder, its line in `rows.jsonl`, from 1, and what must be equal wherever it was measured."""

    folder: Path
    line: int
    cell: str
    values: dict[str, Any]  # of `status`, `mask` and each metric


@dataclass(eq=False)
class _Rows:
    """Contents of folders: the last score row of each key in each, folder, line and machine of time rows by hash."""

    cells: dict[str, list[_Score]] = field(default_factory=dict)
    times: dict[int, tuple[Path, int, str | None]] = field(default_factory=dict)
    abouts: dict[Path, RunFile] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Conflict:
    """A cell with unequal scores; what: a metric, `mask` or `status`; values: of the two folders."""

    cell: str
    what: str
    folders: tuple[Path, Path]
    values: tuple[object, object]


@dataclass(frozen=True)
class MergeResult:
    """Numbers of cells, of time rows and of their machines; with conflicts, nothing was written."""

    cells: int
    times: int
    machines: int
    notes: tuple[str, ...]
    conflicts: tuple[Conflict, ...]


def merge(folders: Sequence[Path], output: Path) -> MergeResult:
    """Merge folders of `run`, or of `stress`, into a new folder, which appears when it is complete.

    Equal keys must have equal scores: if not, nothing is written. Of several folders, the row of the first counts,
    unless it failed. Time rows of every machine are kept. Images are hard links where the disk allows it; a mask is
    only taken if its pixels are those of its row. Raises InputError for folders that do not belong together, and for an
    output that is not new or empty.
    """
    sources = list(dict.fromkeys(folder.resolve() for folder in folders))
    if output.resolve() in sources:
        raise InputError(f"-o {output}: is one of the folders to merge; {_NEW}")
    if output.is_dir() and (files := sorted(file.name for file in output.iterdir())):
        raise InputError(f"-o {output}: found other files, such as {files[0]:.60}; {_NEW}")
    if output.exists() and not output.is_dir():
        raise InputError(f"-o {output}: is a file; {_NEW}")
    rows = _read(sources)
    conflicts = [conflict for scores in rows.cells.values() for conflict in _conflicts(scores)]
    written = [] if conflicts else _write(rows, output)
    counts = len(rows.cells), len(rows.times), len({machine for _, _, machine in rows.times.values()})
    return MergeResult(*counts, (*rows.notes, *written), tuple(conflicts))


def _read(sources: Sequence[Path]) -> _Rows:
    """Read all rows. Raises InputError for folders without cells, or of different commands or renderers."""
    rows = _Rows()
    kinds: dict[str, tuple[set[str], Path]] = {}
    for folder in sources:
        file = rows_file(folder)
        scores: dict[str, _Score] = {}
        commands, renderers, complete = set(), set(), 0
        for number, (row, end) in enumerate(stream_rows(file), start=1):
            complete = end
            if row["kind"] == "score":
                scores[row["key"]] = _Score(folder, number, _name(row), _values(row))
                commands.add("`stress`" if "axis" in row else "`run`")
                renderers |= set() if "content" in row else {row["renderer"]}  # a folder of `score` has none
            else:
                told = hash(json.dumps(row, sort_keys=True))
                rows.times.setdefault(told, (folder, number, row.get("machine")))
        rows.abouts[folder] = read_run_file(folder / "run.json")
        if complete < file.stat().st_size:
            rows.notes.append(f"{folder}: the last row is cut off: its command was stopped; {_AGAIN}")
        elif not rows.abouts[folder]:
            rows.notes.append(f"{folder}: found no run.json; if its command was stopped, {_AGAIN}")
        if not commands and rows.abouts[folder].get("keys") == []:
            continue  # of a part without views
        if len(commands) != 1:
            found = "cells of `run` and of `stress`" if commands else "no cell"
            raise InputError(f"{folder}: found {found}; allowed: cells of one command")
        _check_kind(folder, "command", commands, kinds)
        _check_kind(folder, "renderer", renderers, kinds)
        for key, score in scores.items():
            rows.cells.setdefault(key, []).append(score)
    if not rows.cells:
        raise InputError(f"{sources[0]}: found no cell, as in all others; allowed: cells of one command")
    return rows


def _check_kind(folder: Path, what: str, found: set[str], known: dict[str, tuple[set[str], Path]]) -> None:
    """Raises InputError for cells of another command or renderer than in the first folder that has any."""
    expected, first = known.setdefault(what, (found, folder)) if found else (found, folder)
    if found != expected:
        here, there = (" and ".join(sorted(names)) for names in (found, expected))
        hint = "; `shadowbench report` compares renderers, each in a folder of its own" if what == "renderer" else ""
        raise InputError(f"{folder}: found cells of {here}; allowed: of {there}, as in {first}{hint}")


def _name(row: Record) -> str:
    size = f" at {row['map_size']}" if row["map_size"] else ""
    phase = f" phase {row['phase']}" if row["phase"] else ""
    return f"{row['scene']} {row['view']} {row['light']} {row['spec']}{size}{phase}"


def _values(row: Record) -> dict[str, Any]:
    return {"status": row["status"].partition(":")[0], "mask": row.get("mask_sha256"), **row_metrics(row)}


def _chosen(scores: Sequence[_Score]) -> _Score:
    """The first row that did not fail, else the last one."""
    return next((one for one in scores if one.values["status"] != "failed"), scores[-1])


def _conflicts(scores: Sequence[_Score]) -> Iterator[Conflict]:
    """What differs between the chosen row of a key and the other ones that did not fail."""
    first = _chosen(scores)
    for other in scores:
        if other is first or other.values["status"] == "failed":
            continue
        unequal = [name for name in first.values | other.values if _differ(first, other, name)]
        for name in ["status"] if "status" in unequal else unequal:
            values = first.values.get(name), other.values.get(name)
            yield Conflict(first.cell, name, (first.folder, other.folder), values)


def _differ(first: _Score, other: _Score, name: str) -> bool:
    one, two = first.values.get(name), other.values.get(name)
    if isinstance(one, float) and isinstance(two, float):
        return not math.isclose(one, two, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
    return bool(one != two)


def _write(rows: _Rows, output: Path) -> list[str]:
    """Write all files beside the output, and rename the folder; what a killed merge left there is replaced.

    Returns notes on images, and on cells of the last commands that another row represents.
    """
    target = output.resolve()
    beside = target.with_name(f".{target.name}.merging")
    cells = {key: _chosen(scores) for key, scores in rows.cells.items()}
    held = lock(target.with_name(f".{target.name}.merging.lock"), output, "merge")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir()
        with (beside / "rows.jsonl").open("wb") as merged:
            for source in rows.abouts:
                kept = {score.line for score in cells.values() if score.folder == source}
                kept |= {line for folder, line, _ in rows.times.values() if folder == source}
                with (source / "rows.jsonl").open("rb") as stream:
                    merged.writelines(line for number, line in enumerate(stream, start=1) if number in kept)
        about = _run_file(rows, cells)
        text = json.dumps(escaped(about), indent=2, ensure_ascii=False)
        (beside / "run.json").write_text(text + "\n", encoding="utf-8", errors="replace")
        notes = _link_images(list(rows.abouts), cells, beside)
        hidden = set(about["keys"]) - {row["key"] for row in _write_tables(list(rows.abouts), beside)}
        with suppress(FileNotFoundError):
            target.rmdir()  # an empty one
        beside.rename(target)
    except OSError as error:
        raise InputError(f"-o {output}: cannot be written ({(error.strerror or str(error)).lower()})") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        unlock(held)
    if hidden:
        other = "another folder has them of other code or another version of the scene"
        notes.append(f"{counted(len(hidden), 'cell')} in rows.jsonl but not in the table: {other}")
    return notes


def _write_tables(sources: Sequence[Path], folder: Path) -> Sequence[Record]:
    """Write the tables of a merged folder, and return the rows that they show."""
    runs, sweeps = read_folders([folder])
    if runs:
        tables = [read_sweep_positions(source / "table.csv") for source in sources]
        return write_cells(folder, {spec: points for table in tables for spec, points in table.items()}).rows
    rows = sweeps[0].rows
    # `unshadowed` has no range: it is out of tolerance wherever there is a shadow.
    judged = [row for row in rows if row["technique"] != Unshadowed.name]
    write_table(folder / "ranges.csv", ranges_frame(operating_ranges(AXES.values(), judged)))
    write_table(folder / "table.csv", points_frame(rows))
    return rows


def _link_images(sources: Sequence[Path], cells: Mapping[str, _Score], folder: Path) -> list[str]:
    """Link the first good mask and picture of each cell, and truths; returns notes on files that were refused."""
    masks, pictures = (
        [file for source in sources for file in source.glob(f"{kind}/*.png") if file.stem in cells]
        for kind in ("masks", "pictures")
    )
    # The truth of the last one counts, as its rows come last.
    truths = [file for source in reversed(sources) for file in source.glob("truth/*.png")]
    bad = _link(masks, folder, {key: one.values["mask"] for key, one in cells.items()})
    lost = [file for file in bad if not (folder / "masks" / file.name).exists()]
    told = (
        ([file for file in bad if file not in lost], "mask", "not what was scored: that of another folder is taken"),
        (lost, "mask", "not what was scored: left out, as no folder has a good one; the row stays"),
        (_link(pictures, folder), "image", "no PNG: left out"),
        (_link(truths, folder), "image", "no PNG: left out"),
    )
    return [
        (f"{files[0]}: is " if len(files) == 1 else f"{counted(len(files), noun)}, such as {files[0]}, are ") + fault
        for files, noun, fault in told
        if files
    ]


def _link(files: Iterable[Path], folder: Path, hashes: Mapping[str, str | None] = {}) -> list[Path]:
    """Link or copy files that a folder lacks into its subfolder of the same name; returns those that were refused.

    hashes: of masks, by key. What is no PNG is refused, since a link may lead to any file and a result is handed on.
    """
    refused = []
    for file in files:
        target = folder / file.parent.name / file.name
        if target.exists():
            continue
        try:
            expected = hashes.get(file.stem)
            with open_png(file, "allowed: a PNG"):
                good = expected is None or mask_sha256(read_mask(file)) == expected
        except InputError:
            good = False
        if not good:
            refused.append(file)
            continue
        target.parent.mkdir(exist_ok=True)
        try:
            os.link(file.resolve(), target)  # of a link, the file
        except OSError:  # another disk, or one without links
            shutil.copyfile(file, target)
    return refused


def _run_file(rows: _Rows, cells: Mapping[str, _Score]) -> dict[str, Any]:
    """Contents of `run.json`: facts of the folder with the most times, cells and notes of all, what studies share."""
    times = Counter(machine for _, _, machine in rows.times.values())
    main = max(rows.abouts.values(), key=lambda about: (times[about.get("machine_key")], len(about)))
    notes: dict[str, None] = {}
    keys: dict[str, None] = {}
    for folder, about in rows.abouts.items():
        notes |= dict.fromkeys(about.get("assumptions", ()))
        keys |= dict.fromkeys(about.get("keys", [key for key, one in cells.items() if one.folder == folder]))
    return {
        **main,
        "schema": SCHEMA,
        "command": command_line(),
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "assumptions": list(notes),
        "study": _shared([about["study"] for about in rows.abouts.values() if "study" in about]),
        "keys": [key for key in keys if key in cells],
    }


def _shared(studies: Sequence[StudyFacts]) -> dict[str, Any]:
    """Scenes and specs of all studies, and the values in which they agree."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(name for study in studies for name in study):
        values = [study[name] for study in studies if name in study]  # type: ignore[literal-required]
        if name in ("scenes", "specs"):
            found[name] = list(dict.fromkeys(value for several in values for value in several))
        elif all(value == values[0] for value in values):
            found[name] = values[0]
    return found
