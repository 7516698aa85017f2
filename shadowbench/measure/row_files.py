"""Reading `rows.jsonl` and `run.json`."""

from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from pydantic import ValidationError

from shadowbench.errors import InputError
from shadowbench.measure.rows import ROW, RUN_FILE, SCHEMA, Record, RunFile
from shadowbench.strict import explain

_HEAD = b'{"schema": 1'  # prefix of every line, a truncated one included


def stream_rows(file: Path) -> Iterator[tuple[Record, int]]:
    """Each row of a `rows.jsonl`, and the position in bytes where it ends; after the last, a truncated one may follow.

    Raises InputError, with the line number, for a line that is no row, and for a file that cannot be read.
    """
    end = 0
    try:
        with _open(file) as stream:
            for number, line in enumerate(stream, start=1):
                if line.endswith(b"\n"):
                    end += len(line)
                    yield _row(file, number, line[:-1]), end
                elif not (line.startswith(_HEAD) or _HEAD.startswith(line)):
                    raise InputError(f"{file} line {number}: found no valid row; allowed: a row of schema {SCHEMA}")
    except OSError as error:
        raise _cannot_read(file, error) from None


def _row(file: Path, number: int, line: bytes) -> Record:
    try:
        return ROW.validate_json(line)
    except ValidationError as error:
        raise explain(f"{file} line {number}", error) from None


def read_run_file(file: Path) -> RunFile:
    """Contents of a `run.json`; empty if there is no file. Raises InputError for any other content."""
    if not file.exists():
        return {}
    try:
        return RUN_FILE.validate_json(_bytes(file))
    except ValidationError as error:
        raise explain(str(file), error) from None


def _bytes(file: Path) -> bytes:
    try:
        with _open(file) as stream:
            return stream.read()
    except OSError as error:
        raise _cannot_read(file, error) from None


def _open(file: Path) -> BinaryIO:
    if not file.is_file():  # reading a named pipe would block
        raise InputError(f"{file}: is not a file")
    return file.open("rb")


def _cannot_read(file: Path, error: OSError) -> InputError:
    return InputError(f"{file}: cannot be read ({error.strerror or error})")
