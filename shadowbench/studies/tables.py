"""Tables made of rows: `table.csv`, with one line per cell, and the printed summary."""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from shadowbench.files import replace_file
from shadowbench.measure.flips import FLIPS, ROW_METRICS
from shadowbench.measure.rows import Result
from shadowbench.measure.time_rows import REDRAWN
from shadowbench.scores.metrics import METRICS, Metric, is_soft, ranking
from shadowbench.studies.times import ROUGH, ReferenceTime, normalise_times
from shadowbench.techniques.grammar import parameters_of
from shadowbench.techniques.registry import preset_names

_IDENTITY = ["scene", "view", "light", "phase", "technique", "spec", "map_size", "view_size", "renderer", "status"]
_TIMES = ["frame_ms", "frame_iqr_ms", "added_ms", "ratio", "n", "clock"]
_TOTALS = ["wall_ms", *(f"{moved}_ms" for moved in REDRAWN)]
_LENGTHS = ("fact_bias_m", "fact_bias_texels", "fact_normal_offset_m", "fact_normal_offset_texels")
_MORE_TIMES = ["ratio_iqr", "reference", "reference_ms", *_TOTALS]  # additional columns, after the promised ones
_TRUTH_ERRORS = ["truth_error", "truth_error_pen"]
_SOFT = [*_TRUTH_ERRORS, "penumbra", "width_share", "width_bias"]  # of a soft truth
_MORE = [
    "receivers",
    "undecided",
    "surface_mismatch",
    "coordinates",
    "full_spec",
    "mask_sha256",
    "assumptions",
    "key",
]
_FLIPS = [FLIPS.name, "step"]
_BOOTSTRAPS = 2000
_CHUNK = 5000  # lines of a table in memory at a time


def cells_frame(results: Sequence[Result]) -> pd.DataFrame:
    """One line per cell, with the columns of `table.csv`: the promised ones in their order, then additional ones."""
    return _frame(results, _columns(results))


def cells_frames(results: Sequence[Result], lines: int = _CHUNK) -> Iterator[pd.DataFrame]:
    """The lines of `cells_frame` in frames of so many lines, all with the same columns, for tables of any length."""
    columns = _columns(results)
    for start in range(0, max(len(results), 1), lines):
        yield _frame(results[start : start + lines], columns, start)


def write_table(file: Path, frames: Iterable[pd.DataFrame]) -> None:
    """Write frames of the same columns as one CSV, one after the other; missing values are empty fields."""
    with replace_file(file) as temporary, temporary.open("w", encoding="utf-8", newline="") as stream:
        for index, frame in enumerate(frames):
            frame.to_csv(stream, index=False, header=index == 0)


def _columns(results: Sequence[Result]) -> list[str]:
    passes = {name for result in results for name in (result.time or {}).get("passes", ())}
    work = {name for result in results for name in result.score.get("work", ())}
    facts = {name for result in results for name in result.score.get("facts", ())}
    times = [*_TIMES, *sorted(f"pass_{name}_ms" for name in passes)]
    promised = [*_IDENTITY, *METRICS, *times, *_prefixed("work", work), "gpu_bytes", "prepare_ms", "machine", "command"]
    return [*promised, *_MORE, *_FLIPS, *_SOFT, *_MORE_TIMES, *_prefixed("fact", facts)]


def _prefixed(prefix: str, names: Iterable[str]) -> list[str]:
    return sorted(f"{prefix}_{name}" for name in names)


def _frame(results: Sequence[Result], columns: list[str], start: int = 0) -> pd.DataFrame:
    lines = range(start, start + len(results))
    frame = pd.DataFrame([_cell(result) for result in results], index=lines, columns=columns)
    work = [name for name in columns if name.startswith("work_")]
    whole = [*work, "map_size", "n", "gpu_bytes", "receivers", "undecided", "surface_mismatch", "penumbra"]
    # astype leaves a block for each column, and pandas warns of a hundred when one is added; a copy joins them.
    return frame.astype(dict.fromkeys(whole, "Int64")).copy()


def _cell(result: Result) -> dict[str, Any]:
    score, timed = result.score, result.time or {}
    row = {name: score.get(name) for name in [*_IDENTITY, *_MORE, *_FLIPS, *_SOFT, "gpu_bytes", "command"]} | {
        "status": result.status
    }
    row |= score.get("metrics", {})
    row["assumptions"] = "; ".join(score.get("assumptions", ())) or None
    row |= {f"work_{name}": count for name, count in score.get("work", {}).items()}
    row |= {f"fact_{name}": value for name, value in score.get("facts", {}).items()}
    row |= {key: timed.get(key) for key in [*_TIMES, "prepare_ms", "machine", *_MORE_TIMES]}
    return row | {f"pass_{name}_ms": value["ms"] for name, value in timed.get("passes", {}).items()}


@dataclass(frozen=True)
class Interval:
    """Median over views and phases, with its 95% bootstrap confidence interval and the range of the values.

    low, high: ends of the confidence interval; least, most: of the range. None for one value.
    """

    median: float
    low: float | None = None
    high: float | None = None
    least: float | None = None
    most: float | None = None

    def complement(self) -> "Interval":
        """Interval of 1 − x, which turns a similarity into an error."""
        ends = (None if end is None else 1 - end for end in (self.high, self.low, self.most, self.least))
        return Interval(1 - self.median, *ends)

    def text(self, digits: Callable[[float], str]) -> str:
        """Text such as `0.0123 [0.0110, 0.0140]`; digits: formats a number."""
        if self.low is None or self.high is None:
            return digits(self.median)
        return f"{digits(self.median)} [{digits(self.low)}, {digits(self.high)}]"


@dataclass(frozen=True)
class SummaryRow:
    """Summary of a spec's cells at one map size.

    cells: number of successful cells; refused: statuses of the others; values: medians over the successful cells,
    with times normalised to one reference time; phases: number of phases among the successful cells; unset: numbers at
    their defaults that other specs of the technique set, such as `n=16`.
    """

    spec: str
    map_size: int | None
    cells: int
    refused: tuple[str, ...]
    values: dict[str, Interval | None]
    phases: int
    unset: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """The spec as tables print it: a preset by its name, or with the numbers by which it differs from others."""
        short = preset_names().get(self.spec)
        if short or not self.unset:
            return short or self.spec
        return f"{self.spec}{',' if ':' in self.spec else ':'}{','.join(self.unset)}"

    @property
    def rough(self) -> bool:
        """Whether the IQR of the time is so large that it is only a rough estimate."""
        ms, iqr = self.values.get("frame_ms"), self.values.get("frame_iqr_ms")
        return ms is not None and iqr is not None and iqr.median > ROUGH * ms.median

    @property
    def soft(self) -> bool:
        """Whether the truth has penumbrae."""
        return is_soft(self.values)

    @property
    def ranked_by(self) -> Metric:
        """The metric that ranks its shadows."""
        return ranking(self.soft)

    @property
    def error(self) -> Interval | None:
        """The error by which it is ranked, 1 − IoU or RMSE; None without a score."""
        value = self.values.get(self.ranked_by.name)
        return value.complement() if value is not None and self.ranked_by.better == "higher" else value

    def error_text(self, digits: Callable[[float], str], bounds: bool = True) -> str:
        """Text of the error, by default with its interval, or `<0.0012` below the truth's own error."""
        value = self.error
        if value is None:
            return "–"
        below = self.text(self.ranked_by.name, digits)
        return below if below.startswith("<") else value.text(digits) if bounds else digits(value.median)

    def text(self, name: str, digits: Callable[[float], str]) -> str:
        """Text of a value's median, – for none; ~ for a time that varied widely, `<0.0012` below the truth's error."""
        value = self.values.get(name)
        if value is None:
            return "–"
        if name in METRICS:
            medians = {field: found.median for field in _TRUTH_ERRORS if (found := self.values.get(field)) is not None}
            way = self._way if name == "width" else ""
            return METRICS[name].text(value.median, digits, medians) + way
        return f"{'~' if name.endswith('_ms') and self.rough else ''}{digits(value.median)}"

    @property
    def _way(self) -> str:
        """Whether most penumbrae are drawn too wide or too narrow; empty if about as many are either."""
        width, bias = self.values.get("width"), self.values.get("width_bias")
        if width is None or bias is None or not bias.median or abs(bias.median) < width.median / 2:
            return ""
        return " wide" if bias.median > 0 else " narrow"

    @property
    def single_phase(self) -> bool:
        """Whether a map was scored at a single phase."""
        return self.map_size is not None and self.phases == 1


def interval(values: Sequence[float] | NDArray[np.float64]) -> Interval | None:
    """Median and bootstrap confidence interval (fixed seed) of the values that are not NaN; None if there are none."""
    array = np.asarray(values, dtype=float)
    array = array[~np.isnan(array)]
    if not len(array):
        return None
    if len(array) == 1:
        return Interval(float(array[0]))
    draws = np.random.default_rng(0).choice(array, (_BOOTSTRAPS, len(array)))
    low, high = np.percentile(np.median(draws, axis=1), [2.5, 97.5])
    return Interval(float(np.median(array)), float(low), float(high), float(array.min()), float(array.max()))


def titles(frame: pd.DataFrame) -> pd.Series:
    """Table title of each line: its scene, and its light and renderer where there are several.

    One table for several lights would compare medians over different cells, since techniques differ in the kinds of
    light that they support.
    """
    several = frame.groupby("scene")["light"].transform("nunique") > 1
    found = frame["scene"].where(~several, frame["scene"] + ", " + frame["light"])
    return (found if frame["renderer"].nunique() < 2 else found + ", " + frame["renderer"]).astype(str)


def summary(frame: pd.DataFrame) -> dict[str, list[SummaryRow]]:
    """Summary rows by table title, best first: medians over views and phases, with times normalised."""
    return {
        str(scene): summary_rows(normalise_times(table)[0]) for scene, table in frame.groupby(titles(frame), sort=False)
    }


def reference_times(frame: pd.DataFrame) -> dict[str, ReferenceTime | None]:
    """Reference time of each table of `summary`, by title; None if no cell has a ratio."""
    return {str(scene): normalise_times(table)[1] for scene, table in frame.groupby(titles(frame), sort=False)}


def summary_rows(table: pd.DataFrame) -> list[SummaryRow]:
    """Summary rows of one table, best first; its times must be normalised to one reference time."""
    rows = []
    numbers = _numbers_set(table["spec"])
    names = [*ROW_METRICS, *_TRUTH_ERRORS, "width_bias", *_TIMES[:4], *_TOTALS, "gpu_bytes"]
    names += [name for name in _LENGTHS if name in table]
    columns = {name: table[name].to_numpy(dtype=float, na_value=np.nan) for name in names}
    position = pd.Series(range(len(table)), index=table.index)
    for key, group in table.groupby(["spec", "map_size"], sort=False, dropna=False):
        spec, size = cast("tuple[str, float]", key)
        succeeded = group[group["status"] == "ok"]
        lines = position[succeeded.index].to_numpy()
        values = {name: interval(column[lines]) for name, column in columns.items()}
        refused = tuple(group.loc[group["status"] != "ok", "status"])
        map_size = None if pd.isna(size) else int(size)
        unset = _unset(spec, group["full_spec"].iloc[0], numbers)
        rows.append(SummaryRow(spec, map_size, len(succeeded), refused, values, succeeded["phase"].nunique(), unset))
    return sorted(rows, key=_error)


def _numbers_set(specs: Iterable[str]) -> dict[str, set[str]]:
    """Names of the numbers that specs set, by technique."""
    found: dict[str, set[str]] = {}
    for spec in specs:
        technique, values = parameters_of(spec)
        found.setdefault(technique, set()).update(key for key, value in values.items() if type(value) in (int, float))
    return found


def _unset(spec: str, full_spec: str, numbers: Mapping[str, set[str]]) -> tuple[str, ...]:
    """The numbers of a spec at their defaults that another spec of its technique sets."""
    technique, values = parameters_of(spec)
    if numbers[technique] <= set(values):
        return ()
    return tuple(
        f"{key}={value}"
        for key, value in parameters_of(full_spec)[1].items()
        if key in numbers[technique] and key not in values
    )


def phase_note(rows: Sequence[SummaryRow]) -> str | None:
    """A warning about maps that were scored at one sub-texel offset only; None where there are none."""
    mapped = [row for row in rows if row.map_size is not None and row.cells]
    if not any(row.single_phase for row in mapped):
        return None
    which = "" if all(row.single_phase for row in mapped) else "maps without an interval: "
    return f"{which}scored in one phase (sub-texel offset) only; another may reverse the order of two maps (--phases 8)"


def bias_notes(rows: Sequence[SummaryRow], digits: Callable[[float], str]) -> list[str]:
    """What biases of a fixed size mean on each map, in metres and in texels, for a sun. digits: formats a number."""
    notes = []
    for row in rows:
        bias, bias_texels, offset, offset_texels = (row.values.get(name) for name in _LENGTHS)
        parts = [
            f"{digits(metres.median)} m ({digits(texels.median)} texels) {along}"
            for metres, texels, along in (
                (bias, bias_texels, "along the light"),
                (offset, offset_texels, "along the normal at grazing light"),
            )
            if metres is not None and texels is not None
        ]
        if parts:
            notes.append(f"bias of {row.label} at {row.map_size}: {' and '.join(parts)}")
    return notes


def mean_over_scenes(tables: Mapping[str, Sequence[SummaryRow]]) -> tuple[list[str], list[SummaryRow]]:
    """Scenes in which every cell succeeded, and the mean over these scenes of each spec and map size, best first.

    Means over different sets of scenes would not be comparable. A spec that succeeded nowhere is ignored; times are
    left out.
    """
    answering = {(row.spec, row.map_size) for rows in tables.values() for row in rows if row.cells}
    taken = {scene: [row for row in rows if (row.spec, row.map_size) in answering] for scene, rows in tables.items()}
    scenes = [scene for scene, rows in taken.items() if not any(row.refused for row in rows)]
    found: dict[tuple[str, int | None], list[SummaryRow]] = {}
    for scene in scenes:
        for row in taken[scene]:
            found.setdefault((row.spec, row.map_size), []).append(row)
    means = [
        SummaryRow(
            spec, size, sum(row.cells for row in rows), (), values, min(row.phases for row in rows), rows[0].unset
        )
        for (spec, size), rows in found.items()
        for values in [{name: _mean([row.values.get(name) for row in rows]) for name in [*ROW_METRICS, *_TRUTH_ERRORS]}]
    ]
    return scenes, sorted(means, key=_error)


def _mean(values: Sequence[Interval | None]) -> Interval | None:
    medians = [value.median for value in values if value is not None]
    return Interval(float(np.mean(medians))) if medians else None


def _error(row: SummaryRow) -> tuple[float, str, int]:
    return math.inf if row.error is None else row.error.median, row.spec, row.map_size or 0


@dataclass(frozen=True)
class Slope:
    """Convergence of a spec's error with its map size: d log(error) / d log(size), and the number of phases.

    error: what converges, such as `1 − IoU`.
    """

    scene: str
    error: str
    spec: str
    sizes: tuple[int, ...]
    slope: Interval
    phases: int


def slopes(frame: pd.DataFrame) -> list[Slope]:
    """Convergence slope of every spec with two or more map sizes, fitted per view, light and phase.

    Cells without any error are left out, as log 0 is undefined.
    """
    soft = frame["rmse_pen"].notna().groupby(titles(frame)).transform("any")
    errors = (1 - frame["iou"].astype(float)).where(~soft, frame["rmse"].astype(float))
    at_map_sizes = frame.assign(error=errors)[(frame["status"] == "ok") & frame["map_size"].notna() & (errors > 0)]
    found = []
    for (scene, spec), group in at_map_sizes.groupby([titles(frame)[at_map_sizes.index], "spec"], sort=False):
        fits = []
        for _, one in group.groupby(["view", "light", "phase"]):
            sizes = one["map_size"].astype(float)
            if sizes.nunique() > 1:
                fits.append(float(np.polyfit(np.log(sizes), np.log(one["error"]), 1)[0]))
        slope = interval(fits)
        if slope is not None:
            drawn = tuple(sorted({int(size) for size in group["map_size"]}))
            error = ranking(bool(soft[group.index].any())).error_label
            found.append(Slope(str(scene), error, str(spec), drawn, slope, group["phase"].nunique()))
    return found
