"""How long a study will take: by a model before it starts, corrected by what its cells take once it runs."""

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
_TOGETHER_S = 0.01  # between steps that were measured together, and are reported one after the other
_FADING = 0.9  # weight of what was measured before
_UNKNOWN = 0.25  # greatest share of what is left, by the model, of which nothing is measured


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

    def learn(self, modelled: float, seconds: float) -> None:
        """Add what is done; what was done before fades."""
        self.modelled = _FADING * self.modelled + modelled
        self.seconds = _FADING * self.seconds + seconds


@dataclass
class TimeLeft:
    """Reporter that adds to each step of the cells how long the others will take, once enough is measured to tell.

    Steps are named as `Measurer` names them. Drawing is extrapolated from the cells of the same technique, and timing
    from all that were timed, each weighted by the model. Steps that come together, as those of a view that was timed
    or of a job of a cluster, were measured together: their time is divided among them.
    """

    reporter: Reporter
    clock: Callable[[], float] = monotonic
    kinds: dict[str, _Kind] = field(default_factory=dict)
    _last: float = 0.0
    _together: dict[str, float] = field(default_factory=dict)  # modelled seconds of the last steps, by kind
    _taken: float = 0.0  # seconds that they took

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
    def modelled(self) -> float:
        """Seconds that are left by the model alone."""
        return sum(kind.left for kind in self.kinds.values())

    @property
    def seconds(self) -> float | None:
        """Seconds that are left, as measured; None while kinds with a larger share than _UNKNOWN are not measured."""
        done = [kind for kind in self.kinds.values() if kind.modelled]
        known = sum(kind.left for kind in done)
        if not done or known < (1 - _UNKNOWN) * self.modelled:
            return None
        mean = sum(kind.seconds for kind in done) / sum(kind.modelled for kind in done)
        return sum(kind.left * kind.seconds / kind.modelled for kind in done) + (self.modelled - known) * mean

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
        if now - self._last > _TOGETHER_S:
            self._learn()
        self._taken += now - self._last
        self._last = now
        timed = what.endswith((": timed", ": nothing to time"))
        name = "timed" if timed else what.rpartition(" ")[2].partition(":")[0]
        kind = self.kinds.get(name)
        if kind is not None and kind.steps:
            share = kind.left / kind.steps  # a mean: which of the kind it was is not told
            kind.left -= share
            kind.steps -= 1
            if not what.endswith(": nothing to time"):
                self._together[name] = self._together.get(name, 0.0) + share
        left = self.seconds if self.modelled > 0 else None
        self.reporter.step(what if left is None else f"about {duration(left)} left, {what}")

    def _learn(self) -> None:
        """Divide the time that the last steps took among them by the model."""
        total = sum(self._together.values())
        for name, share in self._together.items():
            self.kinds[name].learn(share, self._taken * share / total)
        self._together, self._taken = {}, 0.0
