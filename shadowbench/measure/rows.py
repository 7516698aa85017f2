"""A run folder's files: schemas of `rows.jsonl` and `run.json`, and reading and appending to them."""

import json
import os
import shlex
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO, Literal, NotRequired

from filelock import FileLock, Timeout
from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    StringConstraints,
    TypeAdapter,
    ValidationError,
    with_config,
)
from typing_extensions import TypedDict

from shadowbench.errors import InputError
from shadowbench.files import remove_temporaries
from shadowbench.scenes.model import Coordinates, LightShape, View
from shadowbench.strict import explain

SCHEMA = 1

Record = Mapping[str, Any]
"""A ScoreRow or a TimeRow, unknown fields included."""

Key = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{24}$")]
Name = Annotated[str, StringConstraints(pattern=r"^[^/\\]*$")]
"""Name of a scene, view or light; `truth/` has files named after them."""
Count = Annotated[int, Field(ge=0, lt=2**63)]
Size = Annotated[int, Field(ge=1, lt=2**31)]
Integer = Annotated[int, Field(ge=-(2**63), lt=2**63)]
NonNegative = Annotated[FiniteFloat, Field(ge=0)]

_ARITHMETIC = ", arithmetic "
_STRICT = ConfigDict(strict=True, extra="allow")


@with_config(_STRICT)
class CellIdentity(TypedDict):
    """Fields that identify a cell independently of source code. `map_size` is None for a technique without a map."""

    scene: Name
    view: Name
    light: Name
    phase: Count
    technique: str
    spec: str
    full_spec: str
    map_size: Size | None
    view_size: Size
    coordinates: Coordinates


@with_config(_STRICT)
class InputRecord(TypedDict):
    """Warnings about a mask from another renderer."""

    warnings: NotRequired[list[str]]


@with_config(_STRICT)
class ScoreRow(CellIdentity):
    """Score record of a cell: measurements if its status is `ok`, and its axis value if `stress` made it.

    command: the command line that produced the row; triangles: of the scene, with its work the input of a device's law,
    which gives no time without it; engine: of another engine's row, which has no `gpu_bytes`, its
    version, renderer, light box and phase; content: digest of the input of another renderer's row, which has
    no `gpu_bytes`. A row of a soft truth has its standard error, root mean square over receivers and over the penumbra,
    the penumbra's pixels, and the share of the truth's edge pixels at which widths are compared.
    """

    schema: Literal[1]
    kind: Literal["score"]
    key: Key
    renderer: str
    status: Annotated[str, StringConstraints(pattern=r"^(ok|(unsupported|failed): .*)$")]
    command: NotRequired[str]

    metrics: NotRequired[dict[str, FiniteFloat | None]]
    receivers: NotRequired[Count]
    undecided: NotRequired[Count]
    gpu_bytes: NotRequired[Count | None]
    work: NotRequired[dict[str, Integer]]
    triangles: NotRequired[Count]
    facts: NotRequired[dict[str, FiniteFloat]]
    mask_sha256: NotRequired[str | None]
    truth_error: NotRequired[NonNegative]
    truth_error_pen: NotRequired[NonNegative]
    penumbra: NotRequired[Count]
    width_share: NotRequired[NonNegative | None]
    width_bias: NotRequired[FiniteFloat | None]
    surface_mismatch: NotRequired[Count]
    assumptions: NotRequired[list[str]]
    flips: NotRequired[FiniteFloat | None]
    step: NotRequired[str]

    engine: NotRequired[dict[str, str]]

    content: NotRequired[str]
    input: NotRequired[InputRecord]

    axis: NotRequired[str]
    axis_value: NotRequired[Integer | FiniteFloat | str]
    axis_unit: NotRequired[str]
    light_kind: NotRequired[LightShape]
    home_spec: NotRequired[str]


@with_config(_STRICT)
class PassTime(TypedDict):
    """Median time of a pass, in milliseconds, and which change makes it redraw."""

    ms: NonNegative
    changes: NotRequired[str]


@with_config(_STRICT)
class TimeRow(TypedDict):
    """Time record of a cell: milliseconds over `n` rounds. Without a `ratio`, `no_ratio` is the reference's status.

    One with a `status`, which says why the timing failed, has no times.
    """

    schema: Literal[1]
    kind: Literal["time"]
    key: Key
    status: NotRequired[Annotated[str, StringConstraints(pattern=r"^failed: .*$")]]
    clock: NotRequired[str]
    n: NotRequired[Annotated[Count, Field(ge=1)]]
    frame_ms: NotRequired[NonNegative]
    frame_iqr_ms: NotRequired[NonNegative]
    wall_ms: NotRequired[NonNegative | None]
    added_ms: NotRequired[FiniteFloat]
    prepare_ms: NotRequired[NonNegative]
    still_ms: NotRequired[NonNegative | None]
    camera_ms: NotRequired[NonNegative | None]
    light_ms: NotRequired[NonNegative | None]
    passes: NotRequired[dict[str, PassTime]]
    machine: NotRequired[str]
    reference: NotRequired[str]
    reference_key: NotRequired[str]
    reference_ms: NotRequired[NonNegative | None]
    ratio: NotRequired[NonNegative | None]
    ratio_iqr: NotRequired[NonNegative | None]
    ratio_quartiles: NotRequired[Annotated[list[NonNegative], Field(min_length=2, max_length=2)] | None]
    no_ratio: NotRequired[str | None]


@with_config(_STRICT)
class MachineFacts(TypedDict, total=False):
    """The computer, in `run.json`."""

    processor: str | None
    cores: int | None
    memory_gib: FiniteFloat
    system: str


@with_config(_STRICT)
class DeviceFacts(TypedDict, total=False):
    """The OpenGL renderer, and whether it is a software renderer, in `run.json`."""

    renderer: str
    software: bool
    version: Count
    subpixel_bits: Count


@with_config(_STRICT)
class StudyFacts(TypedDict, total=False):
    """The measured study, in `run.json`."""

    scenes: list[str]
    specs: list[str]
    reference: str
    view_size: Size
    rounds: Count
    phases: Count
    coordinates: Coordinates
    sun: bool
    no_ground: bool
    up: str
    time: float
    clip: str
    camera: str
    target: str
    lamp: str
    sun_at: str


@with_config(_STRICT)
class RunFile(TypedDict, total=False):
    """`run.json`: description of the last command. `keys` lists its cells."""

    schema: Literal[1]
    command: str
    finished: str
    versions: dict[str, str]
    machine: MachineFacts
    machine_key: str
    device: DeviceFacts
    clock: str
    assumptions: list[str]
    study: StudyFacts
    keys: list[Key]


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


_MEASURED = ("metrics", "receivers", "undecided", "gpu_bytes", "work")
_PLACE = ("axis", "axis_value", "axis_unit", "light_kind", "home_spec")
_BREAKING_METRICS = ("iou", "acne", "leak")  # metrics that decide a breaking point


def _check_score_row(row: ScoreRow) -> ScoreRow:
    """Raises ValueError for a row without the fields that its status, or its being on an axis, requires."""
    ok = row["status"] == "ok"
    needed = (*(_MEASURED if ok else ()), *(_PLACE if "axis" in row else ()))
    lacking = [name for name in needed if name not in row]
    if ok and not lacking:
        lacking = [f"metrics.{name}" for name in _BREAKING_METRICS if "axis" in row and name not in row["metrics"]]
        lacking += ["gpu_bytes"] if row["gpu_bytes"] is None and not {"content", "engine"} & row.keys() else []
    if lacking:
        raise ValueError(f"found no {lacking[0]}; it must be given")
    return row


def _check_time_row(row: TimeRow) -> TimeRow:
    if "status" not in row:
        missing = [name for name in ("clock", "n", "frame_ms", "passes", "ratio") if name not in row]
        if missing:
            raise ValueError(f"found no {missing[0]}; it must be given")
        needed = ("no_ratio",) if row["ratio"] is None else ("ratio_iqr", "reference", "machine")
        lacking = [name for name in needed if row.get(name) is None]
        if lacking:
            raise ValueError(f"found no {lacking[0]} beside ratio; it must be given")
    return row


ROW: TypeAdapter[ScoreRow | TimeRow] = TypeAdapter(
    Annotated[
        Annotated[ScoreRow, AfterValidator(_check_score_row)] | Annotated[TimeRow, AfterValidator(_check_time_row)],
        Discriminator("kind", "kind", "a row whose kind is 'score' or 'time'"),
    ]
)
RUN_FILE: TypeAdapter[RunFile] = TypeAdapter(RunFile)


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
