"""Reading and appending to `rows.jsonl`: a JSON object a line, synced to disk at once, so that a killed run resumes."""

import json
import os
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from filelock import FileLock, Timeout
from pydantic import ValidationError

from shadowbench.errors import InputError
from shadowbench.files import remove_temporaries
from shadowbench.measure.rows import ROW, RUN_FILE, SCHEMA, CellIdentity, Record, RunFile, escaped
from shadowbench.scenes.model import View
from shadowbench.strict import explain

IMAGES = ("masks", "pictures", "truth", "differences")
"""Folders of images in a run folder, written by the program that has locked it."""


_HEAD = b'{"schema": 1'  # prefix of every line, a truncated one included


def stream_rows(file: Path) -> Iterator[tuple[Record, int]]:
    """Each row of a `rows.jsonl`, and the position in bytes where it ends; after the last, a truncated one may follow.

    Raises InputError, with the line number, for a line that is no row, and for a file that cannot be read.
    """
    end = 0
    with _opened(file) as stream:
        for number, line in enumerate(stream, start=1):
            if line.endswith(b"\n"):
                end += len(line)
                yield _valid(ROW, line[:-1], f"{file} line {number}"), end
            elif not (line.startswith(_HEAD) or _HEAD.startswith(line)):
                raise InputError(f"{file} line {number}: found no valid row; allowed: a row of schema {SCHEMA}")


def read_run_file(file: Path) -> RunFile:
    """Contents of a `run.json`; empty if there is no file. Raises InputError for any other content."""
    if not file.exists():
        return {}
    with _opened(file) as stream:
        found: RunFile = _valid(RUN_FILE, stream.read(), str(file))
    return found


@contextmanager
def _opened(file: Path) -> Iterator[BinaryIO]:
    if not file.is_file():  # reading a named pipe would block
        raise InputError(f"{file}: is not a file")
    try:
        with file.open("rb") as stream:
            yield stream
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None


def _valid(schema: Any, text: bytes, where: str) -> Any:
    try:
        return schema.validate_json(text)
    except ValidationError as error:
        raise explain(where, error) from None


def lock(file: Path, folder: Path, command: str) -> FileLock:
    """The lock of a folder, by a file in it or beside it, until `unlock`.

    Raises InputError if another process has it, `command` in words, and if the file cannot be written.
    """
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        found = FileLock(file, timeout=0, thread_local=False, fallback_to_soft=False)
        found.acquire()
    except Timeout:
        told = f"another {command} writes into it; wait for it, or choose another with -o"
        raise InputError(f"{folder}: {told}") from None
    except OSError as error:
        raise _cannot_write(folder, error, "; choose another with -o") from None
    return found


def unlock(held: FileLock) -> None:
    """Release a lock and remove its file."""
    # Removed while still locked: a process that has it open finds that it is gone, and opens a new one.
    Path(held.lock_file).unlink(missing_ok=True)
    held.release()


class RowStore:
    """The `rows.jsonl` of a run folder, locked for writing.

    The last score of each key, and the last time of it on each machine, count. sweep: whether the rows are of `stress`
    (on axes) or of `run`. Raises InputError for a folder with rows of the other command, one that cannot be written,
    and one that another process writes into.
    """

    def __init__(self, folder: Path, sweep: bool = False) -> None:
        self.file = folder / "rows.jsonl"
        self.scores: dict[str, Record] = {}
        self._times: dict[tuple[str, str | None], Record] = {}
        self._lock = lock(folder / "writing.lock", folder, "run")
        try:
            self._open(sweep)
        except BaseException as error:
            unlock(self._lock)
            if isinstance(error, OSError):
                raise _cannot_write(self.file, error) from None
            raise

    def time_on(self, machine: str, key: str) -> Record | None:
        """Time record of a key on a machine, given by its `machine_key`."""
        return self._times.get((key, machine))

    def finished_score(self, key: str) -> Record | None:
        """Score record of a key; None if missing or failed, since a failure may be the machine's and is tried again."""
        row = self.scores.get(key)
        return None if row is None or row["status"].startswith("failed") else row

    def _keep(self, record: Record) -> None:
        if record["kind"] == "score":
            self.scores[record["key"]] = record
        else:
            self._times[record["key"], record.get("machine")] = record

    def _open(self, sweep: bool) -> None:
        for images in IMAGES:  # written under the lock, so that whoever left one there is dead
            remove_temporaries(self.file.parent / images)
        complete = 0
        for row, end in stream_rows(self.file) if self.file.exists() else ():
            if row["kind"] == "score" and ("axis" in row) != sweep:
                found, allowed = ("run", "stress") if sweep else ("stress", "run")
                line = f"{self.file}: found cells of `{found}`; allowed: a folder of `{allowed}`, or a new one"
                raise InputError(line)
            self._keep(row)
            complete = end
        self._stream = self.file.open("ab", buffering=0)  # after a failed write, a buffer would be written on close
        self._stream.truncate(complete)  # drops a partial line of a killed run

    def append(self, *records: Record) -> None:
        """Write records to disk before returning; a score record gets the current command line.

        Raises InputError, with nothing written, if the disk is full.
        """
        signed = {"command": command_line()}
        made = [
            escaped({"schema": SCHEMA, **record, **(signed if record["kind"] == "score" else {})}) for record in records
        ]
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
        for record in made:
            self._keep(record)

    def close(self) -> None:
        """Close the file and unlock the folder."""
        self._stream.close()
        unlock(self._lock)


def identity(view: View, technique: str, spec: str, full_spec: str) -> CellIdentity:
    """Identity of a cell for people and for `check`, independent of versions: without a map, at phase 0."""
    return {
        "scene": view.scene.name,
        "view": view.camera.name,
        "light": view.light.name,
        "phase": 0,
        "technique": technique,
        "spec": spec,
        "full_spec": full_spec,
        "map_size": None,
        "view_size": view.size,
        "coordinates": "relative",
    }


def command_line() -> str:
    """The current command line."""
    return shlex.join(["shadowbench", *sys.argv[1:]])


def _cannot_write(path: Path, error: OSError, instead: str = "") -> InputError:
    return InputError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()}){instead}")
