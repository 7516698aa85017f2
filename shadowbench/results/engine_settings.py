"""Settings of other engines: those that are measured, and what rows say of each."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from statistics import median
from typing import Any, get_args

from shadowbench.measure.rows import Record, stream_rows
from shadowbench.plugin.engine import Engine, Sides
from shadowbench.plugin.registry import engines
from shadowbench.plugin.spec import Spec, parse_spec
from shadowbench.results.folder import Run, rows_file
from shadowbench.scores.metrics import METRICS

ERROR = "iou"


def preset_specs(engine: type[Engine], size: int | None = None) -> dict[Spec, list[str]]:
    """The specs of an engine's presets, with materials single- and double-sided, and the names of each.

    Those that are equal are one, of several names. size: texels along a side of maps, of engines that have them.
    """
    found: dict[Spec, list[str]] = {}
    for preset in engine.presets:
        for sides in get_args(Sides):
            name = f"{engine.name}:preset={preset},sides={sides}"
            spec = parse_spec(name, {engine.name: engine})
            found.setdefault(spec.with_(size=size) if size and spec.has_size else spec, []).append(name)
    return found


@cache
def names_of(engine: type[Engine]) -> Mapping[str, list[str]]:
    """The names of the presets' specs, by these, without map sizes."""
    found: dict[str, list[str]] = {}
    for spec, names in preset_specs(engine).items():
        found.setdefault(spec.sizeless_text, []).extend(names)
    return found


def label_of(engine: str, spec: str, map_size: int | None) -> str:
    """Text of a setting: the name of a preset's spec, else the spec itself, and its map size."""
    known = engines().get(engine)
    name = names_of(known).get(spec, [spec])[0] if known else spec
    return f"`{name}`" + (f" at {map_size}" if map_size else "")


@dataclass(frozen=True, eq=False)
class Setting:
    """A spec of an engine at one map size; rows: of each scene, those of the first phase first."""

    engine: str
    spec: str
    map_size: int | None
    rows: Mapping[str, Sequence[Record]]

    @property
    def label(self) -> str:
        """Its name, that of a preset if it is one, and its map size."""
        return label_of(self.engine, self.spec, self.map_size)

    @property
    def sides(self) -> str:
        """Which materials are double-sided."""
        return "double" if "sides=double" in self.spec else "closed"

    def value(self, scene: str, metric: str) -> float | None:
        """Median of a metric in a scene, over its views, lights and phases; that of `iou` as error, 1 − IoU."""
        rows = [row for row in self.rows.get(scene, ()) if row["status"] == "ok"]
        found = [row["metrics"].get(metric) for row in rows]
        values = [METRICS[metric].error(value) for value in found if value is not None]
        return median(values) if values else None

    def values(self, metric: str) -> list[float]:
        """A metric's value in each scene that has one."""
        return [value for scene in self.rows if (value := self.value(scene, metric)) is not None]

    def median(self, metric: str) -> float | None:
        """Median over scenes."""
        values = self.values(metric)
        return median(values) if values else None


@dataclass(frozen=True, eq=False)
class EngineResults:
    """What a run has of an engine: rows of the version and view size that were measured last.

    left_out: number of rows of other versions or sizes.
    """

    engine: type[Engine]
    run: Run
    rows: Sequence[Record]
    left_out: int

    @property
    def about(self) -> Mapping[str, str]:
        """Its version, renderer, light box and phase; nothing if nothing was drawn."""
        return next((row["engine"] for row in reversed(self.rows) if "engine" in row), {})

    @cached_property
    def settings(self) -> list[Setting]:
        """Its settings: presets, in their order, then others."""
        found: dict[tuple[str, int | None], dict[str, list[Record]]] = {}
        for row in sorted(self.rows, key=lambda row: int(row["phase"])):
            found.setdefault((row["spec"], row["map_size"]), {}).setdefault(row["scene"], []).append(row)
        order = {spec: at for at, spec in enumerate(names_of(self.engine))}
        settings = [Setting(self.engine.name, spec, size, rows) for (spec, size), rows in found.items()]
        return sorted(settings, key=lambda one: (order.get(one.spec, len(order)), one.map_size or 0))

    @property
    def worst(self) -> tuple[Setting, str] | None:
        """The setting and scene of the largest 1 − IoU; None without a score."""
        cells = [(one, scene) for one in self.settings for scene in one.rows if one.value(scene, ERROR) is not None]
        return max(cells, key=lambda cell: cell[0].value(cell[1], ERROR) or 0.0, default=None)

    def best_in(self, scene: str) -> Setting:
        """The setting of the smallest 1 − IoU in a scene, in which there is one."""
        scored = [one for one in self.settings if one.value(scene, ERROR) is not None]
        return min(scored, key=lambda one: one.value(scene, ERROR) or 0.0)


def engine_results(runs: Iterable[Run]) -> dict[str, EngineResults]:
    """The results of each engine, in alphabetical order, from the last of the runs that has any."""
    found: dict[str, EngineResults] = {}
    for run in runs:
        order = {row["key"]: at for at, (row, _) in enumerate(stream_rows(rows_file(run.folder)))}
        for name, engine in engines().items():
            every = [row for row in run.rows if row["technique"] == name and "content" not in row]
            if not every:
                continue
            # The last command's, or else the last in the file.
            last = max(every, key=lambda row: ("engine" in row, row["key"] not in run.earlier, order[row["key"]]))
            version = last.get("engine", {}).get("version")
            rows = [
                row
                for row in every
                if row["view_size"] == last["view_size"] and row.get("engine", {}).get("version", version) == version
            ]
            found[name] = EngineResults(engine, run, rows, len(every) - len(rows))
    return dict(sorted(found.items()))


def errors_by_version(runs: Iterable[Run]) -> dict[tuple[str, str, int | None], dict[str, list[float]]]:
    """By engine, spec and map size, 1 − IoU of each version, if it has several, in the cells that all of them drew."""
    drawn: dict[tuple[str, str, int | None], dict[str, dict[tuple[Any, ...], float]]] = {}
    for run in runs:
        for row, _ in stream_rows(rows_file(run.folder)):  # a run has the last row of each cell alone
            if row["kind"] == "score" and row.get("engine") and row["metrics"].get(ERROR) is not None:
                cell = tuple(row[name] for name in ("scene", "view", "light", "phase", "view_size", "coordinates"))
                versions = drawn.setdefault((row["technique"], row["spec"], row["map_size"]), {})
                versions.setdefault(row["engine"]["version"], {})[cell] = METRICS[ERROR].error(row["metrics"][ERROR])
    found = {}
    for setting, versions in sorted(drawn.items(), key=lambda item: item[0][0]):
        common = set.intersection(*map(set, versions.values()))
        if len(versions) > 1 and common:
            found[setting] = {version: [cells[cell] for cell in common] for version, cells in versions.items()}
    return found
