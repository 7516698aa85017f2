"""Merging of run folders, of several machines or of parts of a study, into one."""

import datetime
import json
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shadowbench.errors import InputError
from shadowbench.extremes.ranges import points_frame, ranges_frame
from shadowbench.measure.row_store import command_line, read_run_file
from shadowbench.measure.rows import SCHEMA, RunFile, StudyFacts
from shadowbench.reports.stability import analyse
from shadowbench.reports.words import counted
from shadowbench.results.bias_sweeps import read_sweep_positions
from shadowbench.results.folder import read_folders, write_cells
from shadowbench.results.joining import Conflict, Joined, join
from shadowbench.results.tables import write_table
from shadowbench.scores.masks import mask_sha256, open_png, read_mask


@dataclass(frozen=True)
class MergeResult:
    """Result of a merge: number of cells and of time rows, machines of the times, notes, and what differs.

    With conflicts, nothing was written.
    """

    cells: int
    times: int
    machines: int
    notes: tuple[str, ...]
    conflicts: tuple[Conflict, ...]


def merge(folders: Sequence[Path], output: Path) -> MergeResult:
    """Merge folders of `run`, or of `stress`, into a new folder, which appears when it is complete.

    Equal keys must have equal scores: if not, nothing is written. A failed row gives way to a successful one. Time rows
    of every machine are kept. Images are hard links where the disk allows it; a mask is only taken if its pixels are
    those of its row. Raises InputError for folders that do not belong together, and for an output that is not new or
    empty.
    """
    sources = list(dict.fromkeys(folder.resolve() for folder in folders))
    _check_output(output, sources)
    joined = join(sources)
    abouts = [read_run_file(folder / "run.json") for folder in sources]
    notes = [
        f"{folder}: the last row is cut off: its command was stopped; repeat it, then merge again"
        for folder in joined.cut_off
    ]
    stopped = [folder for folder, about in zip(sources, abouts, strict=True) if not about]
    notes += [
        f"{folder}: found no run.json; if its command was stopped, repeat it, then merge again"
        for folder in stopped
        if folder not in joined.cut_off
    ]
    if not joined.conflicts:
        notes += _write(joined, sources, abouts, output)
    times = sum(joined.machines.values())
    return MergeResult(len(joined.cells), times, len(joined.machines), tuple(notes), joined.conflicts)


def _check_output(output: Path, sources: Sequence[Path]) -> None:
    if output.resolve() in sources:
        raise InputError(f"-o {output}: is one of the folders to merge; allowed: a new folder, or an empty one")
    with suppress(FileNotFoundError, NotADirectoryError):
        found = next(iter(sorted(file.name for file in output.iterdir())), None)
        if found is not None:
            raise InputError(
                f"-o {output}: found other files, such as {found:.60}; allowed: a new folder, or an empty one"
            )
        return
    if output.exists():
        raise InputError(f"-o {output}: is a file; allowed: a new folder, or an empty one")


def _write(joined: Joined, sources: Sequence[Path], abouts: Sequence[RunFile], output: Path) -> list[str]:
    """Write all files beside the output, and rename the folder; what a killed merge left there is replaced.

    Returns notes: on images that were left out or taken from another folder, and on cells of the last commands that the
    result does not show, as another row represents them.
    """
    beside = output.resolve().with_name(f".{output.resolve().name}.merging")
    try:
        shutil.rmtree(beside, ignore_errors=True)
        beside.mkdir(parents=True)
        _write_rows(joined, sources, beside / "rows.jsonl")
        notes = _link_masks(sources, joined, beside)
        own = (file for source in sources for file in source.glob("pictures/*.png") if file.stem in joined.cells)
        # The truth of the last one counts, as its rows come last.
        truths = (file for source in reversed(sources) for file in source.glob("truth/*.png"))
        for files in (own, truths):
            if refused := _link(files, beside, _is_png):
                notes.append(f"{_files(list(refused.values()), 'image')} no PNG: left out")
        about = _run_file(joined, sources, abouts)
        text = json.dumps(about, indent=2, ensure_ascii=False)
        (beside / "run.json").write_text(text + "\n", encoding="utf-8", errors="replace")
        if joined.sweep:
            _, (sweep,) = read_folders([beside])
            write_table(beside / "ranges.csv", [ranges_frame(analyse(sweep).ranges)])
            write_table(beside / "table.csv", [points_frame(sweep.rows)])
            shown = sweep.rows
        else:
            tables = [read_sweep_positions(source / "table.csv") for source in sources]
            positions = {spec: points for table in tables for spec, points in table.items()}
            shown = write_cells(beside, positions).rows
        with suppress(FileNotFoundError):
            output.resolve().rmdir()  # an empty one
        beside.rename(output.resolve())
        if hidden := len(set(about["keys"]) - {row["key"] for row in shown}):
            notes.append(
                f"{counted(hidden, 'cell')} in rows.jsonl but not in the table: another folder has them of other code "
                "or another version of the scene"
            )
        return notes
    except OSError as error:
        raise InputError(f"-o {output}: cannot be written ({(error.strerror or str(error)).lower()})") from None
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def _write_rows(joined: Joined, sources: Sequence[Path], file: Path) -> None:
    with file.open("wb") as output:
        for index, source in enumerate(sources):
            kept = joined.lines(index)
            with (source / "rows.jsonl").open("rb") as stream:
                output.writelines(line for number, line in enumerate(stream, start=1) if number in kept)


def _link_masks(sources: Sequence[Path], joined: Joined, folder: Path) -> list[str]:
    """Link the first good mask of each cell: one whose pixels are those that its row was scored by. Returns notes."""

    def is_good(file: Path) -> bool:
        try:
            return file.stem not in joined.masks or mask_sha256(read_mask(file)) == joined.masks[file.stem]
        except InputError:
            return False

    files = (file for source in sources for file in source.glob("masks/*.png") if file.stem in joined.cells)
    refused = _link(files, folder, lambda file: file.is_file() and is_good(file))
    lost = [file for name, file in refused.items() if not (folder / "masks" / name).exists()]
    replaced = [file for file in refused.values() if file not in lost]
    notes = []
    if replaced:
        notes.append(f"{_files(replaced, 'mask')} not what was scored: that of another folder is taken")
    if lost:
        notes.append(
            f"{_files(lost, 'mask')} not what was scored: left out, as no folder has a good one; the row stays"
        )
    return notes


def _is_png(file: Path) -> bool:
    """Whether a file is an image, as what a link leads to may not be: a result is handed on, with all its files."""
    try:
        with open_png(file, "allowed: a PNG"):
            return True
    except InputError:
        return False


def _link(files: Iterable[Path], folder: Path, is_good: Callable[[Path], bool]) -> dict[str, Path]:
    """Link or copy good files that a folder lacks into its subfolder of the same name; the others by name."""
    refused: dict[str, Path] = {}
    for file in files:
        target = folder / file.parent.name / file.name
        if target.exists():
            continue
        if not is_good(file):
            refused[file.name] = file
            continue
        target.parent.mkdir(exist_ok=True)
        try:
            os.link(file.resolve(), target)  # of a link, the file
        except OSError:  # another disk, or one without links
            shutil.copyfile(file, target)
    return refused


def _files(files: Sequence[Path], noun: str) -> str:
    """The file, or how many such as the first, up to the verb."""
    return f"{files[0]}: is" if len(files) == 1 else f"{counted(len(files), noun)}, such as {files[0]}, are"


def _run_file(joined: Joined, sources: Sequence[Path], abouts: Sequence[RunFile]) -> dict[str, Any]:
    """Contents of `run.json`: machine and versions of the folder with the most times, cells and notes of all."""
    keys: dict[str, None] = {}
    for index, about in enumerate(abouts):
        own = about.get("keys") or [key for key, place in joined.cells.items() if place.folder == index]
        keys |= dict.fromkeys(key for key in own if key in joined.cells)
    main = max(abouts, key=lambda about: (joined.machines.get(about.get("machine_key"), 0), len(about)))
    assumptions = dict.fromkeys(note for about in abouts for note in about.get("assumptions", ()))
    return {
        **main,
        "schema": SCHEMA,
        "command": command_line(),
        "finished": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "assumptions": list(assumptions),
        "study": _study([about["study"] for about in abouts if "study" in about]),
        "keys": list(keys),
    }


def _study(studies: Sequence[StudyFacts]) -> dict[str, Any]:
    """Scenes and specs of all studies, and the values in which they agree."""
    found: dict[str, Any] = {}
    for name in dict.fromkeys(name for study in studies for name in study):
        values = [study[name] for study in studies if name in study]  # type: ignore[literal-required]
        if name in ("scenes", "specs"):
            found[name] = list(dict.fromkeys(value for several in values for value in several))
        elif all(value == values[0] for value in values):
            found[name] = values[0]
    return found
