"""The colours and point shapes of specs in charts."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from shadowbench.techniques.unshadowed import Unshadowed

INK = "#1a1a1a"
# Okabe & Ito 2008, "Color Universal Design", without black and yellow, which is too faint on white, and ten more with
# L* from 36 to 84, as far apart as possible by CIEDE2000; the first eight are also visible on black.
COLORS = (
    *("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8976FF", "#898989"),
    *("#8900C4", "#626200", "#B1D83B", "#B1003B", "#FFB19D", "#006262", "#D8C4FF", "#9DD8C4"),
)
# SVG paths of Vega's point shapes, within ±6.
OUTLINES = {
    "circle": "M6,0A6,6 0 1 1 -6,0A6,6 0 1 1 6,0",
    "square": "M-5,-5H5V5H-5Z",
    "triangle-up": "M0,-6L6,5H-6Z",
    "diamond": "M0,-6.5L5,0L0,6.5L-5,0Z",
    "cross": "M-6,-2H-2V-6H2V-2H6V2H2V6H-2V2H-6Z",
    "triangle-down": "M0,6L6,-5H-6Z",
    "triangle-right": "M6,0L-5,6V-6Z",
    "triangle-left": "M-6,0L5,6V-6Z",
}
SHAPES = tuple(OUTLINES)
MAX_SHOWN = 8
"""Number of specs that the charts of a page show at a time, each with a unique colour and shape."""
_LEGEND = {"orient": "bottom", "columns": 2, "labelLimit": 340, "symbolOpacity": 1, "symbolSize": 80}


@dataclass(frozen=True)
class Styles:
    """The colour and shape of each spec, the same in every chart of a report.

    legend: whether each chart has a legend of all specs; otherwise the page's script adds `color`, `shape` and `shown`
    to each point, by its common legend.
    """

    specs: tuple[str, ...]
    legend: bool

    def channels(self, shown: Iterable[str]) -> dict[str, Any]:
        """The colour and shape channels of a chart; shown: its specs."""
        if not self.legend:
            return {channel: {"field": channel, "type": "nominal", "scale": None} for channel in ("color", "shape")}
        wanted = set(shown)
        specs = [spec for spec in self.specs if spec in wanted]
        return {
            channel: {"field": "spec", "title": None, "legend": _LEGEND, "scale": self._scale(specs, at)}
            for at, channel in enumerate(("color", "shape"))
        }

    def color_and_shape(self, spec: str) -> tuple[str, str]:
        """The colour and shape of a spec; if colours repeat, the shape differs."""
        index = self.specs.index(spec)
        return COLORS[index % len(COLORS)], SHAPES[(index + index // len(COLORS)) % len(SHAPES)]

    def _scale(self, specs: Sequence[str], at: int) -> dict[str, Any]:
        return {"domain": specs, "range": [self.color_and_shape(spec)[at] for spec in specs]}


def styles_of(specs: Iterable[str], legend: bool) -> Styles:
    """Styles of specs, in the order of the legend: first one of each technique, then the others, `unshadowed` last."""
    every = list(dict.fromkeys(specs))
    first = {spec.partition(":")[0]: spec for spec in reversed(every)}.values()
    return Styles(tuple(sorted(every, key=lambda spec: (spec == Unshadowed.name, spec not in first))), legend)
