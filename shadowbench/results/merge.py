"""Merging of run folders, of several machines or of parts of a study, into one."""

import json
import math
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError
from shadowbench.extremes.axes import AXES
from shadowbench.measure.rows import Record, command_line, read_rows, read_run_file
from shadowbench.results.frame import read_bias_sweeps, read_folders, rows_file, write_cells, write_table
from shadowbench.results.ranges import operating_ranges, points_frame, ranges_frame
from shadowbench.techniques.unshadowed import Unshadowed

_ROUNDING = 1e-9  # relative, or of 1 near 0; sums of floats differ with the width of a processor's vectors


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
    unless it failed. Time rows of every machine are kept. Raises InputError for folders that do not belong together,
    and for an output that is not new or empty.
    """
    sources = list(dict.fromkeys(folder.resolve() for folder in folders))
    if output.exists() and not (output.is_dir() and not any(output.iterdir())):
        raise InputError(f"-o {output}: is not empty; allowed: a new folder, or an empty one")
    scores: dict[str, list[tuple[Path, Record]]] = {}
    times: dict[str, Record] = {}
    abouts = {folder: read_run_file(folder / "run.json") for folder in sources if rows_file(folder)}
    notes: list[str] = []
    expected: dict[str, tuple[str, Path]] = {}
    for folder, about in abouts.items():
        rows, complete = read_rows(rows_file(folder))
        if complete < rows_file(folder).stat().st_size:
            notes.append(f"{folder}: the last row is cut off: its command was stopped; repeat it, then merge again")
        times |= {json.dumps(row, sort_keys=True): row for row in rows if row["kind"] == "time"}
        cells = [row for row in rows if row["kind"] == "score"]
        if not cells and about.get("keys") != []:  # else a part without views
            raise InputError(f"{folder}: found no cell; allowed: cells of one command")
        for row in cells:
            scores.setdefault(row["key"], []).append((folder, row))
            kinds = {"command": "`stress`" if "axis" in row else "`run`"}
            kinds |= {} if "content" in row else {"renderer": row["renderer"]}  # masks of `score` have none
            for what, name in kinds.items():
                known, first = expected.setdefault(what, (name, folder))
                if name != known:
                    raise InputError(f"{folder}: found cells of {name}; allowed: of {known}, as in {first}")
    if not scores:
        raise InputError(f"{sources[0]}: found no cell, as in all others; allowed: cells of one command")
    for key, several in scores.items():
        scores[key] = [one for one in several if not one[1]["status"].startswith("failed")] or several[-1:]
    differing = tuple(one for several in scores.values() for one in _differing(several))
    if not differing:
        _write(abouts, {key: several[0][1] for key, several in scores.items()}, list(times.values()), output)
    return MergeResult(len(scores), len(times), tuple(notes), differing)


def _differing(several: Sequence[tuple[Path, Record]]) -> Iterator[dict[str, Any]]:
    """What differs between the first row of a key, with its folder, and the others."""

    def values_of(row: Record) -> dict[str, Any]:
        return {"status": row["status"].partition(":")[0], "mask": row.get("mask_sha256"), **row.get("metrics", {})}

    def differ(one: Any, other: Any) -> bool:
        near = (
            isinstance(one, float)
            and isinstance(other, float)
            and math.isclose(one, other, rel_tol=_ROUNDING, abs_tol=_ROUNDING)
        )
        return not near and one != other

    (first, row), *others = several
    cell = " ".join(str(row[name]) for name in ("scene", "view", "light", "spec", "map_size", "phase"))
    for folder, other in others:
        values = {name: (values_of(row).get(name), value) for name, value in values_of(other).items()}
        unequal = [name for name, both in values.items() if differ(*both)]
        for name in ["status"] if "status" in unequal else unequal:
            yield {"cell": cell, "what": name, "folders": [str(first), str(folder)], "values": values[name]}


def _write(abouts: Mapping[Path, Record], cells: Mapping[str, Record], times: Sequence[Record], output: Path) -> None:
    """Write all files beside the output, and rename the folder; what a killed merge left there is replaced."""
    target, sources = output.resolve(), list(abouts)
    beside = target.with_name(f".{target.name}.merging")
    keys = dict.fromkeys(key for about in abouts.values() for key in about.get("keys", cells))
    most = Counter(time.get("machine") for time in times)
    studies = [about["study"] for about in abouts.values() if "study" in about]
    study = {
        name: value for name, value in (studies or [{}])[0].items() if all(one.get(name) == value for one in studies)
    }
    for name in ("scenes", "specs"):
        study[name] = list(dict.fromkeys(value for one in studies for value in one.get(name, ())))
    main = max(abouts.values(), key=lambda about: (most[about.get("machine_key")], len(about)))
    about = {
        **main,
        "command": command_line(),
        "assumptions": list(dict.fromkeys(note for one in abouts.values() for note in one.get("assumptions", ()))),
        "study": study,
        "keys": [key for key in keys if key in cells],
    }
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        lines = (json.dumps(row, ensure_ascii=False) + "\n" for row in (*cells.values(), *times))
        (beside / "rows.jsonl").write_text("".join(lines), encoding="utf-8", errors="replace")
        (beside / "run.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
        for folder in (source / images for source in sources for images in ("masks", "pictures", "truth")):
            # The truth of the last one counts, as its rows come last.
            if folder.is_dir():
                shutil.copytree(folder, beside / folder.name, dirs_exist_ok=True)
        _write_tables(sources, beside)
        with suppress(FileNotFoundError):
            target.rmdir()  # an empty one
        beside.rename(target)
    except OSError as error:
        raise InputError(f"-o {output}: cannot be written ({(error.strerror or str(error)).lower()})") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _write_tables(sources: Sequence[Path], folder: Path) -> None:
    runs, sweeps = read_folders([folder])
    if runs:
        tables = [read_bias_sweeps(source / "table.csv") for source in sources]
        write_cells(folder, {spec: home for table in tables for spec, home in table.items()})
        return
    # `unshadowed` has no range: it is out of tolerance wherever there is a shadow.
    judged = [row for row in sweeps[0].rows if row["technique"] != Unshadowed.name]
    write_table(folder / "ranges.csv", ranges_frame(operating_ranges(AXES.values(), judged)))
    write_table(folder / "table.csv", points_frame(sweeps[0].rows))
