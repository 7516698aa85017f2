"""`rows.jsonl` as it grows: one JSON object a line, on disk as soon as it is written, so that a killed run goes on."""

import json
import os
import shlex
import sys
from pathlib import Path
from typing import IO

from shadowbench.errors import InputError
from shadowbench.measure.rows import SCHEMA, Record, read_rows

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl


class RowStore:
    """`rows.jsonl` of a run folder. The last record of a key and kind counts.

    `sweep`: the rows stand on axes. InputError for a folder that holds rows of the other sort, that cannot be written,
    or that another process writes into.
    """

    def __init__(self, folder: Path, sweep: bool = False) -> None:
        self.file = folder / "rows.jsonl"
        self.scores: dict[str, Record] = {}
        self.times: dict[str, Record] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(folder)
        except OSError as error:
            raise _cannot_write(folder, error) from None
        try:
            self._open(sweep)
        except BaseException as error:
            self._unlock()
            if isinstance(error, OSError):
                raise _cannot_write(self.file, error) from None
            raise

    def _open(self, sweep: bool) -> None:
        rows, end = read_rows(self.file) if self.file.exists() else ([], 0)
        if any(("axis" in row) != sweep for row in rows if row["kind"] == "score"):
            found, allowed = ("run", "stress") if sweep else ("stress", "run")
            raise InputError(f"{self.file}: found cells of `{found}`; allowed: a folder of `{allowed}`, or a new one")
        for row in rows:
            self._keep(row)
        self._stream = self.file.open("ab", buffering=0)  # what a buffer holds would be written again at the end
        self._stream.truncate(end)  # killed in the middle of a line: that row was never finished

    def _keep(self, record: Record) -> None:
        (self.scores if record["kind"] == "score" else self.times)[record["key"]] = record

    def append(self, record: Record) -> None:
        """Keep a record, on disk before this returns; InputError, and nothing is written, where the disk is full.

        A score record gets the command that made it.
        """
        made = {"command": command_line()} if record["kind"] == "score" else {}
        record = {"schema": SCHEMA, **record, **made}
        # Half a surrogate, as a file's name in no UTF-8 has it, is no JSON.
        line = (json.dumps(record, allow_nan=False, ensure_ascii=False) + "\n").encode(errors="replace")
        end = self._stream.seek(0, os.SEEK_END)
        try:
            while line:
                line = line[self._stream.write(line) :]
            os.fsync(self._stream.fileno())
        except OSError as error:
            self._stream.truncate(end)
            raise _cannot_write(self.file, error) from None
        self._keep(record)

    def done(self, key: str) -> Record | None:
        """The score record of a key, unless it failed: that is tried again, as it may have been the machine."""
        row = self.scores.get(key)
        return None if row is None or row["status"].startswith("failed") else row

    def close(self) -> None:
        """Close the file, and let others write into the folder."""
        self._stream.close()
        self._unlock()

    def _unlock(self) -> None:
        # First the file, while nobody else can hold it: who has opened it before sees that it is gone.
        Path(self._lock.name).unlink(missing_ok=True)
        self._lock.close()


def command_line() -> str:
    """The command as it was typed."""
    return shlex.join(["shadowbench", *sys.argv[1:]])


def _cannot_write(path: Path, error: OSError) -> InputError:
    return InputError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()})")


def _locked(folder: Path) -> IO[str]:
    """The lock of a folder, held until it is closed or this process ends, however; InputError while another has it.

    A lock on a file that its last holder has removed keeps nobody out: the next one is taken.
    """
    file = folder / "writing.lock"
    while True:
        lock = file.open("a", encoding="utf-8")
        try:
            if sys.platform == "win32":
                msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
            else:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            raise InputError(f"{folder}: another run writes into it; wait for it, or choose another with -o") from None
        if _is_there(lock, file):
            return lock
        lock.close()


def _is_there(lock: IO[str], file: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(lock.fileno()), file.stat())
    except FileNotFoundError:
        return False
