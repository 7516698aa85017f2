"""What a run folder's files hold: the rows of `rows.jsonl` and the object of `run.json`, read through one model each.

A folder may come from anybody. What is read here has the types below, finite numbers, and keys and names that stay
inside the folder when a path is made of them; anything else is an InputError. Fields that this version does not know
are kept.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, NotRequired

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
from shadowbench.scenes.model import Coordinates, LightKind
from shadowbench.strict import explain

SCHEMA = 1
_HEAD = b'{"schema": 1'  # how every line begins, also one that was cut short

Record = Mapping[str, Any]
"""A ScoreRow or a TimeRow, with whatever else it holds."""

Key = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{24}$")]
Name = Annotated[str, StringConstraints(pattern=r"^[^/\\\x00]*$")]
"""Of a scene, view or light: `truth/` has a file that is called after them."""
Count = Annotated[int, Field(ge=0, lt=2**63)]
Size = Annotated[int, Field(ge=1, lt=2**31)]
Whole = Annotated[int, Field(ge=-(2**63), lt=2**63)]
Positive = Annotated[FiniteFloat, Field(ge=0)]

_STRICT = ConfigDict(strict=True, extra="allow")


@with_config(_STRICT)
class CellIdentity(TypedDict):
    """What names a cell for people and for `check`, whatever its sources. `map_size` is None without a map."""

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
class HandedOver(TypedDict):
    """What was noticed of a mask from elsewhere."""

    warnings: NotRequired[list[str]]


@with_config(_STRICT)
class ScoreRow(CellIdentity):
    """What a cell drew. One that is `ok` has the measurements; one on an axis of `stress` has its place there.

    `command` made it. `content`: of another renderer's row, the key of what was handed over; such a row has no
    `gpu_bytes`.
    """

    schema: Literal[1]
    kind: Literal["score"]
    key: Key
    renderer: str
    status: Annotated[str, StringConstraints(pattern=r"^(ok|(unsupported|failed): (?s:.*))$")]
    command: NotRequired[str]

    metrics: NotRequired[dict[str, FiniteFloat | None]]
    receivers: NotRequired[Count]
    undecided: NotRequired[Count]
    gpu_bytes: NotRequired[Count | None]
    work: NotRequired[dict[str, Whole]]
    facts: NotRequired[dict[str, FiniteFloat]]
    mask_sha256: NotRequired[str | None]
    surface_mismatch: NotRequired[Count]
    assumptions: NotRequired[list[str]]
    flips: NotRequired[FiniteFloat | None]

    content: NotRequired[str]
    input: NotRequired[HandedOver]

    axis: NotRequired[str]
    axis_value: NotRequired[Whole | FiniteFloat | str]
    axis_unit: NotRequired[str]
    light_kind: NotRequired[LightKind]
    home_spec: NotRequired[str]


@with_config(_STRICT)
class PassTime(TypedDict):
    """The median of a pass, and when it has to be drawn again."""

    ms: Positive
    changes: NotRequired[str]


@with_config(_STRICT)
class TimeRow(TypedDict):
    """What a cell took, in milliseconds; `n` rounds. Without a `ratio`, `no_ratio` is the reference's status."""

    schema: Literal[1]
    kind: Literal["time"]
    key: Key
    clock: str
    n: Annotated[Count, Field(ge=1)]
    frame_ms: Positive
    frame_iqr_ms: NotRequired[Positive]
    wall_ms: NotRequired[Positive | None]
    added_ms: NotRequired[FiniteFloat]
    prepare_ms: NotRequired[Positive]
    still_ms: NotRequired[Positive | None]
    camera_ms: NotRequired[Positive | None]
    light_ms: NotRequired[Positive | None]
    passes: dict[str, PassTime]
    machine: NotRequired[str]
    reference: NotRequired[str]
    reference_key: NotRequired[str]
    reference_ms: NotRequired[Positive | None]
    ratio: Positive | None
    ratio_iqr: NotRequired[Positive | None]
    ratio_quartiles: NotRequired[Annotated[list[Positive], Field(min_length=2, max_length=2)] | None]
    no_ratio: NotRequired[str | None]


@with_config(_STRICT)
class MachineFacts(TypedDict, total=False):
    """Of `run.json`: the computer."""

    processor: str | None
    cores: int | None
    memory_gib: FiniteFloat
    system: str


@with_config(_STRICT)
class DeviceFacts(TypedDict, total=False):
    """Of `run.json`: who drew, and whether a processor did it in place of a GPU."""

    renderer: str
    software: bool
    version: Count
    subpixel_bits: Count


@with_config(_STRICT)
class StudyFacts(TypedDict, total=False):
    """Of `run.json`: what was asked for."""

    scenes: list[str]
    specs: list[str]
    reference: str
    view_size: Size
    rounds: Count
    phases: Count
    coordinates: Coordinates


@with_config(_STRICT)
class RunFile(TypedDict, total=False):
    """`run.json`: how the last command made the folder. `keys` are its cells; older folders lack them."""

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


@dataclass(frozen=True, eq=False)
class Result:
    """A cell's rows: its score record, and its time record where it has one; `untimed` says why timing it failed."""

    score: Record
    time: Record | None
    untimed: str | None = None

    @property
    def status(self) -> str:
        """`ok`, `unsupported: …` or `failed: …`, also for a cell that fails only while it is timed."""
        return str(self.score["status"]) if self.untimed is None else f"failed: while timed: {self.untimed}"


_MEASURED = ("metrics", "receivers", "undecided", "gpu_bytes", "work")
_PLACE = ("axis", "axis_value", "axis_unit", "light_kind", "home_spec")
_JUDGED = ("iou", "acne", "leak")  # what a breaking point is told by


def _whole_score(row: ScoreRow) -> ScoreRow:
    """Raises ValueError for a row that lacks what its status, or its place on an axis, promises."""
    ok = row["status"] == "ok"
    needed = (*(_MEASURED if ok else ()), *(_PLACE if "axis" in row else ()))
    lacking = [name for name in needed if name not in row]
    if ok and not lacking:
        lacking = [f"metrics.{name}" for name in _JUDGED if "axis" in row and name not in row["metrics"]]
        lacking += ["gpu_bytes"] if row["gpu_bytes"] is None and "content" not in row else []
    if lacking:
        raise ValueError(f"found no {lacking[0]}; it must be given")
    _check_unknown(row, _SCORE_FIELDS)
    return row


def _whole_time(row: TimeRow) -> TimeRow:
    needed = ("no_ratio",) if row["ratio"] is None else ("ratio_iqr", "reference", "machine")
    lacking = [name for name in needed if row.get(name) is None]
    if lacking:
        raise ValueError(f"found no {lacking[0]} beside ratio; it must be given")
    _check_unknown(row, _TIME_FIELDS)
    return row


def _check_unknown(row: Record, typed: frozenset[str]) -> None:
    """Raises ValueError for NaN or infinity where nothing has a type: JSON has neither, and nobody could write it."""
    for name in row.keys() - typed:
        if not _is_finite(row[name]):
            raise ValueError(f"{name}: found NaN or infinity; allowed: what JSON has")


def _is_finite(value: object) -> bool:
    if isinstance(value, dict | list):
        return all(map(_is_finite, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, float) or math.isfinite(value)


_SCORE_FIELDS = frozenset({*CellIdentity.__annotations__, *ScoreRow.__annotations__} - {"input"})
_TIME_FIELDS = frozenset(TimeRow.__annotations__.keys() - {"passes"})
_ROW: TypeAdapter[ScoreRow | TimeRow] = TypeAdapter(
    Annotated[
        Annotated[ScoreRow, AfterValidator(_whole_score)] | Annotated[TimeRow, AfterValidator(_whole_time)],
        Discriminator("kind", "kind", "a row whose kind is 'score' or 'time'"),
    ]
)
_RUN_FILE: TypeAdapter[RunFile] = TypeAdapter(RunFile)


def read_rows(file: Path) -> tuple[list[Record], int]:
    """Every row of a `rows.jsonl`, and the bytes they take; after those stands at most a row that was cut short.

    Raises InputError, with the line's number, for a line that is no row, and for a file that cannot be read.
    """
    text = _bytes(file)
    end = text.rfind(b"\n") + 1
    torn = text[end:]
    lines = text[:end].split(b"\n")[:-1]
    rows = [_row(file, number, line) for number, line in enumerate(lines, start=1)]
    if not (torn.startswith(_HEAD) or _HEAD.startswith(torn)):
        raise InputError(f"{file} line {len(lines) + 1}: found no row; allowed: a row of schema {SCHEMA}")
    return rows, end


def _row(file: Path, number: int, line: bytes) -> Record:
    try:
        return _ROW.validate_json(line)
    except ValidationError as error:
        raise explain(f"{file} line {number}", error) from None


def read_run_file(file: Path) -> RunFile:
    """A `run.json`; empty where there is none. Raises InputError for anything else."""
    if not file.exists():
        return {}
    try:
        return _RUN_FILE.validate_json(_bytes(file))
    except ValidationError as error:
        raise explain(str(file), error) from None


def _bytes(file: Path) -> bytes:
    try:
        if not file.is_file():  # a pipe would be waited for
            raise InputError(f"{file}: is not a file")
        return file.read_bytes()
    except OSError as error:
        raise InputError(f"{file}: cannot be read ({error.strerror or error})") from None
