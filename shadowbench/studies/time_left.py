"""How long a study will take: by a model before it starts, corrected by what its cells take once it runs."""

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from time import monotonic

from shadowbench.measure.bench import Reporter
from shadowbench.measure.cells import Cell
from shadowbench.measure.flips import size_after
from shadowbench.studies.study import Study

_PIXEL_S = 12e-9  # seconds of a drawn pixel or texel, on two cores without a GPU
_DRAWN = 4  # frames that take as long as drawing and scoring a cell
_TIMED = 4 / 3  # frames of a round, with the passes


def drawing_seconds(study: Study, cell: Cell) -> float:
    """Approximate seconds of drawing and scoring a cell on two cores without a GPU."""
    stepped = size_after(study.step, study.view_size) ** 2
    return _PIXEL_S * _DRAWN * (_pixels(study, cell) + stepped)


def timing_seconds(study: Study, cell: Cell) -> float:
    """Approximate seconds of timing a cell on two cores without a GPU."""
    return _PIXEL_S * _TIMED * study.rounds * _pixels(study, cell) if cell.phase == 0 else 0.0


def _pixels(study: Study, cell: Cell) -> int:
    return study.view_size**2 + (cell.spec.map_size or 0) ** 2


def duration(seconds: float) -> str:
    """Text of a rough duration: `40 s`, `12 min`, `2.5 h`."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


@dataclass
class _Kind:
    """Steps of similar cost; modelled: of what is done, for the seconds that it took."""

    left: float = 0.0
    steps: int = 0
    modelled: float = 0.0
    seconds: float = 0.0


@dataclass
class TimeLeft:
    """Reporter that adds to each step of the cells how long the others will take.

    Steps are named as `Measurer` names them. Drawing is extrapolated from the cells of the same technique, and timing
    from all that were timed, each weighted by the model; what has none yet, from the rest.
    """

    reporter: Reporter
    clock: Callable[[], float] = monotonic
    kinds: dict[str, _Kind] = field(default_factory=dict)
    _last: float | None = None

    def expect(self, study: Study, cells: Iterable[Cell], timed: Iterable[Cell]) -> None:
        """Add cells that will be drawn, and cells that will be timed."""
        for cell in cells:
            self._add(cell.spec.technique.name, drawing_seconds(study, cell))
        for cell in timed:
            self._add("timed", timing_seconds(study, cell))

    def _add(self, name: str, seconds: float) -> None:
        kind = self.kinds.setdefault(name, _Kind())
        kind.left += seconds
        kind.steps += 1

    @property
    def seconds(self) -> float:
        """Seconds that are left."""
        done = [kind for kind in self.kinds.values() if kind.modelled]
        modelled, taken = (sum(map(operator.attrgetter(name), done)) for name in ("modelled", "seconds"))
        others = taken / modelled if modelled else 1.0
        return sum(
            kind.left * (kind.seconds / kind.modelled if kind.modelled else others) for kind in self.kinds.values()
        )

    def note(self, line: str) -> None:
        """Show one line to the user."""
        self.reporter.note(line)

    def stage(self, name: str, total: int | None) -> None:
        """Begin a stage."""
        self._last = self.clock()
        self.reporter.stage(name, total)

    def step(self, what: str) -> None:
        """Count one step as done."""
        now = self.clock()
        taken = 0.0 if self._last is None else now - self._last
        self._last = now
        timed = what.endswith((": timed", ": nothing to time"))
        kind = self.kinds.get("timed" if timed else what.rpartition(" ")[2].partition(":")[0])
        if kind is not None and kind.steps:
            share = kind.left / kind.steps  # a mean: which of the kind it was is not told
            kind.left -= share
            kind.steps -= 1
            if not what.endswith(": nothing to time"):
                kind.modelled += share
                kind.seconds += taken
        left = self.seconds
        self.reporter.step(f"about {duration(left)} left, {what}" if left > 0 else what)
