"""What a metric is: a function of a mask and its truth, with what reports and checks need to know of its values."""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from shadowbench.scores.comparison import Comparison

Function = Callable[[Comparison], float | None]
Better = Literal["higher", "lower", "near 0", "near 1"]
Kind = Literal["hard", "soft", "both"]


@dataclass(frozen=True)
class Metric:
    """A row of the table of metrics.

    kind: the shadows it suits, hard-edged, soft or both; tolerance: change against a baseline that is not reported;
    resolution: field of a row with the truth's own error, below which a value means nothing, None if there is none;
    label: its name in sentences and headings; targets: the values that reports ask for, from easy to hard.
    """

    name: str
    function: Function
    better: Better
    kind: Kind
    help: str
    tolerance: float = 0.001
    resolution: Literal["truth_error", "truth_error_pen"] | None = None
    label: str = ""
    targets: tuple[float, ...] = ()

    @property
    def error_label(self) -> str:
        """Heading of its error, such as `1 − IoU`."""
        return f"1 − {self.label}" if self.better == "higher" else self.label

    def suits(self, soft: bool) -> bool:
        """Whether it is shown of hard shadows, or of soft ones: of those, what recommendations may ask for too."""
        return not soft or self.kind != "hard" or bool(self.targets)

    def error(self, value: float) -> float:
        """The error of a value: 1 − x of a similarity, else the value."""
        return 1 - value if self.better == "higher" else value

    def meets(self, value: float, limit: float) -> bool:
        """Whether a value is as good as a limit."""
        return value >= limit if self.better == "higher" else value <= limit

    def text(self, value: float | None, digits: Callable[[float], str], fields: Mapping[str, Any]) -> str:
        """Text of a value, – for None; `<0.0012` for one below the truth's own error, one of the fields of its row."""
        least = None if self.resolution is None else fields.get(self.resolution)
        if value is None:
            return "–"
        return f"<{digits(least)}" if least is not None and value < least else digits(value)

    def digits_beside(self, limit: float, digits: Callable[[float], str]) -> Callable[[float], str]:
        """Formats a value by `digits`, or longer where that rounds it across a limit, or to a similarity of 1."""

        def side(value: float) -> tuple[bool, bool]:
            return self.meets(value, limit), self.better == "higher" and value == 1

        def text(value: float) -> str:
            longer = (f"{value:.{places}g}" for places in range(4, 18))
            return next(one for one in (digits(value), *longer) if side(float(one)) == side(value))

        return text

    def worse(self, before: float, after: float) -> float:
        """By how much a value has become worse; below 0 if it has become better."""
        if self.better == "higher":
            return before - after
        if self.better == "lower":
            return after - before
        ideal = 0.0 if self.better == "near 0" else 1.0
        return abs(after - ideal) - abs(before - ideal)


METRICS: dict[str, Metric] = {}
"""All metrics by name, in the order of the columns."""


def metric(better: Better, kind: Kind, **given: Any) -> Callable[[Function], Function]:
    """Decorator: add a function to METRICS, with its docstring as help; given: further fields of `Metric`."""

    def add(function: Function) -> Function:
        name, help = function.__name__, " ".join((inspect.getdoc(function) or "").split())
        METRICS[name] = Metric(name, function, better, kind, help, **given)
        return function

    return add
