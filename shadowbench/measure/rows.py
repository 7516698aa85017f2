"""Schemas of a run folder's files: the rows of `rows.jsonl` and the object in `run.json`.

A run folder is untrusted input. The models below check types, require finite numbers, and reject keys and names that
would leave the folder when used in a path; anything else raises InputError. Unknown fields are kept.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NotRequired

from pydantic import (
    AfterValidator,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    StringConstraints,
    TypeAdapter,
    with_config,
)
from typing_extensions import TypedDict

from shadowbench.scenes.model import Coordinates, LightShape

SCHEMA = 1

Record = Mapping[str, Any]
"""A ScoreRow or a TimeRow, unknown fields included."""

Key = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{24}$")]
_CONTROL = r"\x00-\x1f\x7f-\x9f"
CONTROLS = re.compile(f"[{_CONTROL}]")
Text = Annotated[str, StringConstraints(pattern=rf"^[^{_CONTROL}]*$")]
"""Text without control characters, which would reach a terminal; `RowStore` writes them escaped."""
Name = Annotated[str, StringConstraints(pattern=rf"^[^/\\{_CONTROL}]*$")]
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
    technique: Text
    spec: Text
    full_spec: Text
    map_size: Size | None
    view_size: Size
    coordinates: Coordinates


@with_config(_STRICT)
class InputRecord(TypedDict):
    """Warnings about a mask from another renderer."""

    warnings: NotRequired[list[Text]]


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
    renderer: Text
    status: Annotated[str, StringConstraints(pattern=rf"^(ok|(unsupported|failed): [^{_CONTROL}]*)$")]
    command: NotRequired[Text]

    metrics: NotRequired[dict[Text, FiniteFloat | None]]
    receivers: NotRequired[Count]
    undecided: NotRequired[Count]
    gpu_bytes: NotRequired[Count | None]
    work: NotRequired[dict[Text, Integer]]
    triangles: NotRequired[Count]
    facts: NotRequired[dict[Text, FiniteFloat]]
    mask_sha256: NotRequired[Text | None]
    truth_error: NotRequired[NonNegative]
    truth_error_pen: NotRequired[NonNegative]
    penumbra: NotRequired[Count]
    width_share: NotRequired[NonNegative | None]
    width_bias: NotRequired[FiniteFloat | None]
    surface_mismatch: NotRequired[Count]
    assumptions: NotRequired[list[Text]]
    flips: NotRequired[FiniteFloat | None]
    step: NotRequired[Text]

    engine: NotRequired[dict[Text, Text]]

    content: NotRequired[Text]
    input: NotRequired[InputRecord]

    axis: NotRequired[Text]
    axis_value: NotRequired[Integer | FiniteFloat | Text]
    axis_unit: NotRequired[Text]
    light_kind: NotRequired[LightShape]
    home_spec: NotRequired[Text]


@with_config(_STRICT)
class PassTime(TypedDict):
    """Median time of a pass, in milliseconds, and which change makes it redraw."""

    ms: NonNegative
    changes: NotRequired[Text]


@with_config(_STRICT)
class TimeRow(TypedDict):
    """Time record of a cell: milliseconds over `n` rounds. Without a `ratio`, `no_ratio` is the reference's status.

    One with a `status`, which says why the timing failed, has no times.
    """

    schema: Literal[1]
    kind: Literal["time"]
    key: Key
    status: NotRequired[Annotated[str, StringConstraints(pattern=rf"^failed: [^{_CONTROL}]*$")]]
    clock: NotRequired[Text]
    n: NotRequired[Annotated[Count, Field(ge=1)]]
    frame_ms: NotRequired[NonNegative]
    frame_iqr_ms: NotRequired[NonNegative]
    wall_ms: NotRequired[NonNegative | None]
    added_ms: NotRequired[FiniteFloat]
    prepare_ms: NotRequired[NonNegative]
    still_ms: NotRequired[NonNegative | None]
    camera_ms: NotRequired[NonNegative | None]
    light_ms: NotRequired[NonNegative | None]
    passes: NotRequired[dict[Text, PassTime]]
    machine: NotRequired[Text]
    reference: NotRequired[Text]
    reference_key: NotRequired[Text]
    reference_ms: NotRequired[NonNegative | None]
    ratio: NotRequired[NonNegative | None]
    ratio_iqr: NotRequired[NonNegative | None]
    ratio_quartiles: NotRequired[Annotated[list[NonNegative], Field(min_length=2, max_length=2)] | None]
    no_ratio: NotRequired[Text | None]


@with_config(_STRICT)
class MachineFacts(TypedDict, total=False):
    """The computer, in `run.json`."""

    processor: Text | None
    cores: int | None
    memory_gib: FiniteFloat
    system: Text


@with_config(_STRICT)
class DeviceFacts(TypedDict, total=False):
    """The OpenGL renderer, and whether it is a software renderer, in `run.json`."""

    renderer: Text
    software: bool
    version: Count
    subpixel_bits: Count


@with_config(_STRICT)
class StudyFacts(TypedDict, total=False):
    """The measured study, in `run.json`."""

    scenes: list[Text]
    specs: list[Text]
    reference: Text
    view_size: Size
    rounds: Count
    phases: Count
    coordinates: Coordinates
    sun: bool
    no_ground: bool
    up: Text
    time: float
    clip: Text
    camera: Text
    target: Text
    lamp: Text
    sun_at: Text


@with_config(_STRICT)
class RunFile(TypedDict, total=False):
    """`run.json`: description of the last command. `keys` lists its cells; older folders lack it."""

    schema: Literal[1]
    command: Text
    finished: Text
    versions: dict[Text, Text]
    machine: MachineFacts
    machine_key: Text
    device: DeviceFacts
    clock: Text
    assumptions: list[Text]
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
    _check_unknown(row, _SCORE_FIELDS)
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
    _check_unknown(row, _TIME_FIELDS)
    return row


def _check_unknown(row: Record, typed: frozenset[str]) -> None:
    """Raises ValueError for what typed fields may not have either, in unknown ones.

    NaN and infinity are no JSON, so that they could not be written back.
    """
    for name in row.keys() - typed:
        if not _is_plain(row[name]):
            raise ValueError(
                f"{name}: found NaN, infinity or a control character; allowed: finite numbers, printable text"
            )


def _is_plain(value: object) -> bool:
    if type(value) is float:  # most values, so it comes first
        return math.isfinite(value)
    if isinstance(value, str):
        return CONTROLS.search(value) is None
    if isinstance(value, dict):
        return all(map(_is_plain, [*value, *value.values()]))
    return not isinstance(value, list) or all(map(_is_plain, value))


_SCORE_FIELDS = frozenset({*CellIdentity.__annotations__, *ScoreRow.__annotations__} - {"input"})
_TIME_FIELDS = frozenset(TimeRow.__annotations__.keys() - {"passes"})
ROW: TypeAdapter[ScoreRow | TimeRow] = TypeAdapter(
    Annotated[
        Annotated[ScoreRow, AfterValidator(_check_score_row)] | Annotated[TimeRow, AfterValidator(_check_time_row)],
        Discriminator("kind", "kind", "a row whose kind is 'score' or 'time'"),
    ]
)
RUN_FILE: TypeAdapter[RunFile] = TypeAdapter(RunFile)


def escaped(value: Any) -> Any:
    """A JSON value whose texts have control characters escaped, as rows are written."""
    if isinstance(value, str):
        return CONTROLS.sub(lambda found: ascii(found[0])[1:-1], value)
    if isinstance(value, Mapping):
        return {escaped(name): escaped(part) for name, part in value.items()}
    return [escaped(part) for part in value] if isinstance(value, list | tuple) else value


def renderer_of(driver: str, arithmetic: str | None) -> str:
    """The column `renderer`, in which rows of one cell may differ: a driver's names, and how it calculates if known.

    Mesa's software renderer names the vector width only. With and without fused multiply-add, which it uses where the
    processor has it, half of the masks differ in single pixels.
    """
    return driver if arithmetic is None else f"{driver}{_ARITHMETIC}{arithmetic}"


def driver_of(renderer: str) -> str:
    """The driver's names in a column `renderer`."""
    return renderer.partition(_ARITHMETIC)[0]
