"""Rows on disk: one JSON object a line, flushed as it is written, so that a killed run goes on where it stopped."""

import json
import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

from shadowbench.errors import InputError

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

SCHEMA = 1
_HEAD = json.dumps({"schema": SCHEMA})[:-1].encode()  # how every line begins, also one that was cut short

Record = Mapping[str, Any]


def row_of(line: bytes) -> Record | None:
    """The record of a line of `rows.jsonl`; None for a line that is no row of this schema."""
    try:
        record: Record = json.loads(line)
        known = record["schema"] == SCHEMA and record["kind"] in ("score", "time") and isinstance(record["key"], str)
    except (ValueError, KeyError, TypeError):
        return None
    return record if known else None


class RowStore:
    """`rows.jsonl` of a run folder. The last record of a key and kind counts."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "rows.jsonl"
        self.scores: dict[str, Record] = {}
        self.times: dict[str, Record] = {}
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = _locked(folder)
        except OSError as error:
            raise InputError(f"{folder}: cannot be written ({error.strerror or error})") from None
        try:
            for record in self._read():
                self._keep(record)
            self._stream = self.file.open("a", encoding="utf-8")
        except BaseException as error:
            self._unlock()
            if isinstance(error, OSError):
                raise InputError(f"{self.file}: cannot be written ({error.strerror or error})") from None
            raise

    def _read(self) -> list[Record]:
        if not self.file.exists():
            return []
        text = self.file.read_bytes()
        whole = text[: text.rfind(b"\n") + 1]
        records = []
        for number, line in enumerate(whole.splitlines(), start=1):
            record = row_of(line)
            if record is None:
                raise self._foreign(number)
            records.append(record)
        torn = text[len(whole) :]
        if not (torn.startswith(_HEAD) or _HEAD.startswith(torn)):
            raise self._foreign(len(records) + 1)
        if torn:  # killed in the middle of a line: that row was never finished
            with self.file.open("r+b") as stream:
                stream.truncate(len(whole))
        return records

    def _foreign(self, number: int) -> InputError:
        return InputError(f"{self.file} line {number}: not a row of schema {SCHEMA}; move the file away")

    def _keep(self, record: Record) -> None:
        (self.scores if record["kind"] == "score" else self.times)[record["key"]] = record

    def append(self, record: Record) -> None:
        """Keep a record, on disk before this returns."""
        self._stream.write(json.dumps({"schema": SCHEMA, **record}, allow_nan=False) + "\n")
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._keep(record)

    def close(self) -> None:
        """Close the file, and let others write into the folder."""
        self._stream.close()
        self._unlock()

    def _unlock(self) -> None:
        Path(self._lock.name).unlink(missing_ok=True)
        self._lock.close()


def _locked(folder: Path) -> IO[str]:
    """The lock of a folder, held until it is closed or this process ends, however; InputError while another has it."""
    lock = (folder / "writing.lock").open("a", encoding="utf-8")
    try:
        if sys.platform == "win32":
            msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        lock.close()
        raise InputError(f"{folder}: another run writes into it; wait for it, or choose another with -o") from None
    return lock
