"""What a spec looks like in every chart of a report."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

# Okabe & Ito 2008, "Color Universal Design", without the yellow that white paper swallows.
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
SHAPES = ("circle", "square", "triangle-up", "diamond", "cross", "triangle-down")
_LEGEND = {"orient": "bottom", "columns": 2, "labelLimit": 340, "symbolOpacity": 1, "symbolSize": 80}


@dataclass(frozen=True)
class Styles:
    """A colour and a shape for each spec, the same in every chart of a report; a page has its own `legend`."""

    specs: tuple[str, ...]
    legend: bool

    def channels(self, shown: Iterable[str]) -> dict[str, Any]:
        """Colour and shape by spec, with one legend for both."""
        legend = _LEGEND if self.legend else None
        wanted = set(shown)
        specs = [spec for spec in self.specs if spec in wanted]
        return {
            channel: {"field": "spec", "title": None, "legend": legend, "scale": self._scale(specs, marks)}
            for channel, marks in (("color", COLORS), ("shape", SHAPES))
        }

    def mark(self, spec: str) -> tuple[str, str]:
        """Its colour and its shape."""
        index = self.specs.index(spec)
        return COLORS[index % len(COLORS)], SHAPES[index % len(SHAPES)]

    def _scale(self, specs: Sequence[str], marks: Sequence[str]) -> dict[str, Any]:
        return {"domain": specs, "range": [marks[self.specs.index(spec) % len(marks)] for spec in specs]}


def styles_of(specs: Iterable[str], legend: bool) -> Styles:
    """Styles for specs, in the order in which they were measured."""
    return Styles(tuple(dict.fromkeys(specs)), legend)
