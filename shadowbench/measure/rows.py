"""A run folder's files: schemas of `rows.jsonl` and `run.json`, and reading and appending to them."""

import json
import os
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal

from filelock import FileLock, Timeout
from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    FiniteFloat,
    GetCoreSchemaHandler,
    GetPydanticSchema,
    StringConstraints,
    TypeAdapter,
    ValidationError,
)
from pydantic_core import CoreSchema, core_schema

from shadowbench.errors import InputError
from shadowbench.files import remove_temporaries
from shadowbench.options import ViewSize
from shadowbench.scenes.model import Coordinates, LightShape, View
from shadowbench.strict import explain

SCHEMA = 1

Record = Mapping[str, Any]
"""A row, a score or a time, or the contents of `run.json`; with all that is unknown here."""

Key = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{24}$")]
Name = Annotated[str, StringConstraints(pattern=r"^[^/\\]*$")]
"""Name of a scene, view or light; `truth/` has files named after them."""
Count = Annotated[int, Field(ge=0, lt=2**63)]
Size = Annotated[int, Field(ge=1, lt=2**31)]
Integer = Annotated[int, Field(ge=-(2**63), lt=2**63)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]

_ARITHMETIC = ", arithmetic "


def _table(required: Mapping[str, Any], optional: Mapping[str, Any]) -> Any:
    """Type of a dictionary with these fields, strictly of these types, and any others."""

    def schema(_: object, handler: GetCoreSchemaHandler) -> CoreSchema:
        fields = {
            name: core_schema.typed_dict_field(handler.generate_schema(kind), required=name in required)
            for name, kind in {**required, **optional}.items()
        }
        return core_schema.typed_dict_schema(fields, config={"strict": True}, extra_behavior="allow")

    return Annotated[dict[str, Any], GetPydanticSchema(schema)]


_SCORE = _table(
    {
        "schema": Literal[1],
        "kind": Literal["score"],
        "key": Key,
        "status": Annotated[str, StringConstraints(pattern=r"^(ok|(unsupported|failed): .*)$")],
        **dict.fromkeys(("scene", "view", "light"), Name),
        **dict.fromkeys(("technique", "spec", "full_spec", "renderer"), str),
        "phase": Count,
        "map_size": Size | None,
        "view_size": Size,
        "coordinates": Coordinates,
    },
    {
        "metrics": dict[str, FiniteFloat | None],
        "work": dict[str, Integer],
        "facts": dict[str, FiniteFloat],
        "gpu_bytes": Count | None,
        "mask_sha256": str | None,
        "width_share": NonNegative | None,
        **dict.fromkeys(("receivers", "undecided", "triangles", "penumbra", "surface_mismatch"), Count),
        **dict.fromkeys(("truth_error", "truth_error_pen"), NonNegative),
        "width_bias": FiniteFloat | None,
        "by_frame": dict[str, list[FiniteFloat | None]],
        "pop_frame": Count | None,
        "frames": Size,
        "sequence": str | None,
        **dict.fromkeys(("command", "content", "axis", "axis_unit", "home_spec"), str),
        "view_width": Size,
        "axis_value": Integer | FiniteFloat | str,
        "light_kind": LightShape,
        "assumptions": list[str],
        "engine": dict[str, str],
        "input": _table({}, {"warnings": list[str]}),
    },
)
_TIME = _table(
    {"schema": Literal[1], "kind": Literal["time"], "key": Key},
    {
        "status": Annotated[str, StringConstraints(pattern=r"^failed: .*$")],
        "n": Annotated[int, Field(ge=1, lt=2**63)],
        "added_ms": FiniteFloat,
        **dict.fromkeys(("clock", "machine", "reference", "reference_key"), str),
        **dict.fromkeys(("frame_ms", "frame_iqr_ms", "prepare_ms"), NonNegative),
        **dict.fromkeys(("wall_ms", "still_ms", "camera_ms", "light_ms"), NonNegative | None),
        **dict.fromkeys(("reference_ms", "ratio", "ratio_iqr"), NonNegative | None),
        "no_ratio": str | None,
        "passes": dict[str, dict[str, FiniteFloat | str]],
    },
)
_RUN_FILE: TypeAdapter[Record] = TypeAdapter(
    _table(
        {},
        {
            **dict.fromkeys(("command", "finished", "machine_key", "clock"), str),
            **dict.fromkeys(("machine", "device", "versions", "study"), dict[str, Any]),
            "assumptions": list[str],
            "keys": list[Key],
        },
    )
)


STILL: Mapping[str, Any] = {"sequence": None, "frames": 1}
"""Fields of a score row that is of no sequence."""


def _complete(row: Record) -> Record:
    """Raises ValueError for a row without the fields that its status, or its being on an axis, requires."""
    needed = list[str]()
    if row["kind"] == "time" and "status" not in row:
        needed = ["clock", "n", "frame_ms", "passes", "ratio"]
        needed += ["no_ratio"] if row.get("ratio") is None else ["ratio_iqr", "reference", "machine"]
    elif row["kind"] == "score":
        needed = ["metrics", "receivers", "undecided", "gpu_bytes", "work"] if row["status"] == "ok" else []
        needed += ["axis_value", "axis_unit", "light_kind", "home_spec"] if "axis" in row else []
    if missing := [name for name in needed if name not in row]:
        raise ValueError(f"found no {missing[0]}; it must be given")
    # Older rows are of squares that do not move.
    return {"view_width": row["view_size"], **STILL, **row} if row["kind"] == "score" else row


def size_of(row: Record) -> ViewSize:
    """Size of a score row's view."""
    return ViewSize(row["view_width"], row["view_size"])


_KIND = Discriminator("kind", "kind", "a row whose kind is 'score' or 'time'")
_ANY_ROW: Any = Annotated[Annotated[_SCORE | _TIME, _KIND], AfterValidator(_complete)]
_ROW: TypeAdapter[Record] = TypeAdapter(_ANY_ROW)


@dataclass(frozen=True, eq=False, slots=True)
class Result:
    """Score record of a cell, and its last time record if any, which may tell that the timing failed."""

    score: Record
    last_time: Record | None

    @property
    def time(self) -> Record | None:
        """The time record; None if the cell was not timed, or if that failed."""
        return None if self.last_time is None or "status" in self.last_time else self.last_time

    @property
    def status(self) -> str:
        """`ok`, `unsupported: …` or `failed: …`; the last also for a cell that failed only during timing."""
        if self.last_time is not None and "status" in self.last_time:
            return f"failed: while timed: {self.last_time['status'].removeprefix('failed: ')}"
        return str(self.score["status"])


def renderer_of(driver: str, arithmetic: str | None) -> str:
    """The column `renderer`, in which rows of one cell may differ: a driver's names, and how it calculates if known.

    Mesa's software renderer names the vector width only. With and without fused multiply-add, which it uses where the
    processor has it, half of the masks differ in single pixels.
    """
    return driver if arithmetic is None else f"{driver}{_ARITHMETIC}{arithmetic}"


def driver_of(renderer: str) -> str:
    """The driver's names in a column `renderer`."""
    return renderer.partition(_ARITHMETIC)[0]


IMAGES = ("masks", "pictures", "truth", "differences")
"""Folders of images in a run folder, written by the program that has locked it."""


_HEAD = b'{"schema": 1'  # prefix of every line, a truncated one included


def read_rows(file: Path) -> tuple[list[Record], int]:
    """The rows of a `rows.jsonl`, and the position in bytes where the last one ends; a truncated one may follow.

    Raises InputError, with the line number, for a line that is no row, and for a file that cannot be read.
    """
    rows, end = list[Record](), 0
    with _opened(file) as stream:
        for number, line in enumerate(stream, start=1):
            if line.endswith(b"\n"):
                end += len(line)
                rows.append(_valid(_ROW, line[:-1], f"{file} line {number}"))
            elif not (line.startswith(_HEAD) or _HEAD.startswith(line)):
                raise InputError(f"{file} line {number}: found no valid row; allowed: a row of schema {SCHEMA}")
    return rows, end


def read_run_file(file: Path) -> Record:
    """Contents of a `run.json`; empty if there is no file. Raises InputError for any other content."""
    if not file.exists():
        return {}
    with _opened(file) as stream:
        found: Record = _valid(_RUN_FILE, stream.read(), str(file))
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
        self._lock = FileLock(folder / "writing.lock", timeout=0, thread_local=False, fallback_to_soft=False)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock.acquire()
        except Timeout:
            instead = "wait for it, or choose another with -o"
            raise InputError(f"{folder}: another run writes into it; {instead}") from None
        except OSError as error:
            raise _cannot_write(folder, error, "; choose another with -o") from None
        try:
            self._open(sweep)
        except BaseException as error:
            self._unlock()
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
        rows, complete = read_rows(self.file) if self.file.exists() else ([], 0)
        for row in rows:
            if row["kind"] == "score" and ("axis" in row) != sweep:
                found, allowed = ("run", "stress") if sweep else ("stress", "run")
                line = f"{self.file}: found cells of `{found}`; allowed: a folder of `{allowed}`, or a new one"
                raise InputError(line)
            self._keep(row)
        self._stream = self.file.open("ab", buffering=0)  # after a failed write, a buffer would be written on close
        self._stream.truncate(complete)  # drops a partial line of a killed run

    def append(self, *records: Record) -> None:
        """Write records to disk before returning; a score record gets the current command line.

        Raises InputError, with nothing written, if the disk is full.
        """
        signed = {"command": command_line()}
        made = [{"schema": SCHEMA, **record, **(signed if record["kind"] == "score" else {})} for record in records]
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
        self._unlock()

    def _unlock(self) -> None:
        # Removed while still locked: a process that has it open finds that it is gone, and opens a new one.
        Path(self._lock.lock_file).unlink(missing_ok=True)
        self._lock.release()


def identity(view: View, technique: str, spec: str, full_spec: str) -> dict[str, Any]:
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
        **view.size.columns,
        **STILL,
        "coordinates": "relative",
    }


def command_line() -> str:
    """The current command line."""
    return shlex.join(["shadowbench", *sys.argv[1:]])


def _cannot_write(path: Path, error: OSError, instead: str = "") -> InputError:
    return InputError(f"{path}: cannot be written ({(error.strerror or str(error)).lower()}){instead}")
