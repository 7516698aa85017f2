"""Appending to `rows.jsonl`: one JSON object a line, synced to disk at once, so that a killed run can resume."""

import json
import os
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path

from filelock import FileLock, Timeout

from shadowbench.errors import InputError
from shadowbench.files import remove_temporaries
from shadowbench.measure.row_files import stream_rows
from shadowbench.measure.rows import SCHEMA, CellIdentity, Record
from shadowbench.scenes.model import Coordinates, View

IMAGES = ("masks", "pictures", "truth", "differences")
"""Folders of images in a run folder, written by the program that has locked it."""


class Rows:
    """Score and time records in memory. The last score of each key, and the last time of it on each machine, count."""

    def __init__(self, known: Iterable[Record] = ()) -> None:
        self.scores: dict[str, Record] = {}
        self._times: dict[tuple[str, str | None], Record] = {}
        for record in known:
            self._keep(record)

    def append(self, *records: Record) -> None:
        """Add records."""
        for record in records:
            self._keep(record)

    def _keep(self, record: Record) -> None:
        if record["kind"] == "score":
            self.scores[record["key"]] = record
        else:
            self._times[record["key"], record.get("machine")] = record

    def time_on(self, machine: str, key: str) -> Record | None:
        """Time record of a key on a machine, given by its `machine_key`."""
        return self._times.get((key, machine))

    def finished_score(self, key: str) -> Record | None:
        """Score record of a key; None if missing or failed, since a failure may be the machine's and is tried again."""
        row = self.scores.get(key)
        return None if row is None or row["status"].startswith("failed") else row


class RowStore(Rows):
    """The `rows.jsonl` of a run folder, locked for writing.

    sweep: whether the rows are of `stress` (on axes) or of `run`. Raises InputError for a folder with rows of the other
    command, one that cannot be written, and one that another process writes into.
    """

    def __init__(self, folder: Path, sweep: bool = False) -> None:
        super().__init__()
        self.file = folder / "rows.jsonl"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FileLock(folder / "writing.lock", timeout=0, thread_local=False, fallback_to_soft=False)
            self._lock.acquire()
        except Timeout:
            raise InputError(f"{folder}: another run writes into it; wait for it, or choose another with -o") from None
        except OSError as error:
            raise _cannot_write(folder, error, "; choose another with -o") from None
        try:
            self._open(sweep)
        except BaseException as error:
            self._unlock()
            if isinstance(error, OSError):
                raise _cannot_write(self.file, error) from None
            raise

    def _open(self, sweep: bool) -> None:
        for images in IMAGES:  # written under the lock, so that whoever left one there is dead
            remove_temporaries(self.file.parent / images)
        complete = 0
        for row, end in stream_rows(self.file) if self.file.exists() else ():
            if row["kind"] == "score" and ("axis" in row) != sweep:
                found, allowed = ("run", "stress") if sweep else ("stress", "run")
                raise InputError(
                    f"{self.file}: found cells of `{found}`; allowed: a folder of `{allowed}`, or a new one"
                )
            self._keep(row)
            complete = end
        self._stream = self.file.open("ab", buffering=0)  # after a failed write, a buffer would be written on close
        self._stream.truncate(complete)  # drops a partial line of a killed run

    def append(self, *records: Record) -> None:
        """Write records to disk before returning; a score record gets the current command line.

        Raises InputError, with nothing written, if the disk is full.
        """
        made = [_complete(record) for record in records]
        # A lone surrogate, from a file name that is not UTF-8, cannot be encoded.
        lines = "".join(json.dumps(record, allow_nan=False, ensure_ascii=False) + "\n" for record in made)
        left = lines.encode(errors="replace")
        end = self._stream.seek(0, os.SEEK_END)
        try:
            while left:
                left = left[self._stream.write(left) :]
            os.fsync(self._stream.fileno())
        except OSError as error:
            self._stream.truncate(end)
            raise _cannot_write(self.file, error) from None
        super().append(*made)

    def close(self) -> None:
        """Close the file and unlock the folder."""
        self._stream.close()
        self._unlock()

    def _unlock(self) -> None:
        # Removed while still locked: a process that has it open finds that it is gone, and opens a new one.
        Path(self._lock.lock_file).unlink(missing_ok=True)
        self._lock.release()


def identity(
    view: View,
    *,
    technique: str,
    spec: str,
    full_spec: str,
    map_size: int | None = None,
    phase: int = 0,
    coordinates: Coordinates = "relative",
) -> CellIdentity:
    """Identity of a cell for people and for `check`, independent of versions."""
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        "phase": phase,
        "technique": technique,
        "spec": spec,
        "full_spec": full_spec,
        "map_size": map_size,
        "view_size": view.size,
        "coordinates": coordinates,
    }


def _complete(record: Record) -> Record:
    return {"schema": SCHEMA, **record, **({"command": command_line()} if record["kind"] == "score" else {})}


def command_line() -> str:
    """The current command line."""
    return shlex.join(["shadowbench", *sys.argv[1:]])


def _cannot_write(path: Path, error: OSError, instead: str = "") -> InputError:
    return InputError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()}){instead}")
