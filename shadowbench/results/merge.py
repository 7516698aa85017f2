"""Merging of run folders, of several machines or of parts of a study, into one."""

import json
import math
import os
import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.errors import InputError
from shadowbench.extremes.axes import AXES
from shadowbench.measure.flips import row_metrics
from shadowbench.measure.rows import Record, command_line, read_run_file, stream_rows
from shadowbench.results.frame import read_folders, read_sweep_positions, rows_file, write_cells, write_table
from shadowbench.results.ranges import operating_ranges, points_frame, ranges_frame
from shadowbench.techniques.unshadowed import Unshadowed

_ROUNDING = 1e-9  # relative, or of 1 near 0; sums of floats differ with the width of a processor's vectors


class _Score(NamedTuple):
    """A score row: its folder, its line in `rows.jsonl`, from 1, and what must be equal wherever it was measured."""

    folder: Path
    line: int
    cell: str
    values: dict[str, Any]  # of `status`, `mask` and each metric


@dataclass(frozen=True)
class MergeResult:
    """Numbers of cells and times, notes, and what differs between equal cells: if anything, nothing was written."""

    cells: int
    times: int
    notes: tuple[str, ...]
    differing: tuple[dict[str, Any], ...]


def merge(folders: Sequence[Path], output: Path) -> MergeResult:
    """Merge folders of `run`, or of `stress`, into a new folder, which appears when it is complete.

    Equal keys must have equal scores: if not, nothing is written. Of several folders, the row of the first counts,
    unless it failed. Time rows of every machine are kept. Images are hard links where the disk allows it. Raises
    InputError for folders that do not belong together, and for an output that is not new or empty.
    """
    sources = list(dict.fromkeys(folder.resolve() for folder in folders))
    if output.exists() and not (output.is_dir() and not any(output.iterdir())):
        raise InputError(f"-o {output}: is not empty; allowed: a new folder, or an empty one")
    scores: dict[str, list[_Score]] = {}
    times: dict[str, tuple[Path, int, str | None]] = {}
    abouts = {folder: read_run_file(folder / "run.json") for folder in sources if rows_file(folder)}
    notes = []
    expected: dict[str, tuple[set[str], Path]] = {}
    for folder, about in abouts.items():
        own: dict[str, _Score] = {}
        kinds: dict[str, set[str]] = {"command": set(), "renderer": set()}
        complete = 0
        for number, (row, end) in enumerate(stream_rows(rows_file(folder)), start=1):
            complete = end
            if row["kind"] == "time":
                times.setdefault(json.dumps(row, sort_keys=True), (folder, number, row.get("machine")))
                continue
            values = {"status": row["status"].partition(":")[0], "mask": row.get("mask_sha256"), **row_metrics(row)}
            own[row["key"]] = _Score(folder, number, _name(row), values)
            kinds["command"].add("`stress`" if "axis" in row else "`run`")
            kinds["renderer"] |= set() if "content" in row else {row["renderer"]}  # masks of `score` have none
        if complete < rows_file(folder).stat().st_size:
            notes.append(f"{folder}: the last row is cut off: its command was stopped; repeat it, then merge again")
        if not own and about.get("keys") != []:  # else a part without views
            raise InputError(f"{folder}: found no cell; allowed: cells of one command")
        for what, names in kinds.items():
            known, first = expected.setdefault(what, (names, folder)) if names else (names, folder)
            if names != known or (what == "command" and len(names) > 1):
                there = f", as in {first}" if names != known else ""
                here, allowed = " and of ".join(sorted(names)), min(known)
                raise InputError(f"{folder}: found cells of {here}; allowed: of {allowed}{there}")
        for key, score in own.items():
            scores.setdefault(key, []).append(score)
    if not scores:
        raise InputError(f"{sources[0]}: found no cell, as in all others; allowed: cells of one command")
    differing = tuple(one for several in scores.values() for one in _differing(several))
    if not differing:
        _write(abouts, {key: _chosen(several) for key, several in scores.items()}, list(times.values()), output)
    return MergeResult(len(scores), len(times), tuple(notes), differing)


def _name(row: Record) -> str:
    size = f" at {row['map_size']}" if row["map_size"] else ""
    phase = f" phase {row['phase']}" if row["phase"] else ""
    return f"{row['scene']} {row['view']} {row['light']} {row['spec']}{size}{phase}"


def _chosen(scores: Sequence[_Score]) -> _Score:
    """The first row that did not fail, else the last one."""
    return next((score for score in scores if score.values["status"] != "failed"), scores[-1])


def _differing(scores: Sequence[_Score]) -> Iterator[dict[str, Any]]:
    """What differs between the chosen row of a key and the other ones that did not fail."""

    def differ(one: Any, other: Any) -> bool:
        if isinstance(one, float) and isinstance(other, float):
            return not math.isclose(one, other, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
        return bool(one != other)

    first = _chosen(scores)
    for other in (score for score in scores if score.values["status"] != "failed"):
        values = {name: (first.values.get(name), other.values.get(name)) for name in first.values | other.values}
        unequal = [name for name, both in values.items() if differ(*both)]
        for name in ["status"] if "status" in unequal else unequal:
            folders = [str(first.folder), str(other.folder)]
            yield {"cell": first.cell, "what": name, "folders": folders, "values": values[name]}


def _write(
    abouts: Mapping[Path, Record],
    cells: Mapping[str, _Score],
    times: Sequence[tuple[Path, int, str | None]],
    output: Path,
) -> None:
    """Write all files beside the output, and rename the folder; what a killed merge left there is replaced."""
    target, sources = output.resolve(), list(abouts)
    beside = target.with_name(f".{target.name}.merging")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        with (beside / "rows.jsonl").open("wb") as merged:
            for source in sources:
                kept = {score.line for score in cells.values() if score.folder == source}
                kept |= {line for folder, line, _ in times if folder == source}
                with (source / "rows.jsonl").open("rb") as stream:
                    merged.writelines(line for number, line in enumerate(stream, start=1) if number in kept)
        of_folders = [about.get("keys", cells) for about in abouts.values()]
        keys = dict.fromkeys(key for several in of_folders for key in several)
        most = Counter(machine for *_, machine in times)
        main = max(abouts.values(), key=lambda about: (most[about.get("machine_key")], len(about)))
        about = {
            **main,
            "command": command_line(),
            "assumptions": list(dict.fromkeys(note for one in abouts.values() for note in one.get("assumptions", ()))),
            "study": _shared([one["study"] for one in abouts.values() if "study" in one]),
            "keys": [key for key in keys if key in cells],
        }
        (beside / "run.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
        images = [file for source in sources for kind in ("masks", "pictures") for file in source.glob(f"{kind}/*.png")]
        # The truth of the last one counts, as its rows come last.
        truths = [file for source in reversed(sources) for file in source.glob("truth/*.png")]
        _link([*(file for file in images if file.stem in cells), *truths], beside)
        _write_tables(sources, beside)
        with suppress(FileNotFoundError):
            target.rmdir()  # an empty one
        beside.rename(target)
    except OSError as error:
        raise InputError(f"-o {output}: cannot be written ({(error.strerror or str(error)).lower()})") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _link(files: Iterable[Path], folder: Path) -> None:
    """Link or copy files that a folder lacks into its subfolder of the same name."""
    for file in files:
        target = folder / file.parent.name / file.name
        if not target.exists():
            target.parent.mkdir(exist_ok=True)
            try:
                os.link(file.resolve(), target)  # of a link, the file
            except OSError:  # another disk, or one without links
                shutil.copyfile(file, target)


def _write_tables(sources: Sequence[Path], folder: Path) -> None:
    runs, sweeps = read_folders([folder])
    if runs:
        tables = [read_sweep_positions(source / "table.csv") for source in sources]
        write_cells(folder, {spec: points for table in tables for spec, points in table.items()})
        return
    # `unshadowed` has no range: it is out of tolerance wherever there is a shadow.
    judged = [row for row in sweeps[0].rows if row["technique"] != Unshadowed.name]
    write_table(folder / "ranges.csv", ranges_frame(operating_ranges(AXES.values(), judged)))
    write_table(folder / "table.csv", points_frame(sweeps[0].rows))


def _shared(studies: Sequence[Record]) -> dict[str, Any]:
    """Scenes and specs of all studies, and the values in which they agree."""
    shared: dict[str, Any] = {}
    for name in dict.fromkeys(name for study in studies for name in study):
        values = [study[name] for study in studies if name in study]
        if name in ("scenes", "specs"):
            shared[name] = list(dict.fromkeys(value for several in values for value in several))
        elif all(value == values[0] for value in values):
            shared[name] = values[0]
    return shared
