"""Charts of bias sweeps: acne against peter-panning over bias factors, one per swept spec, with a line per map size."""

from shadowbench.reports.axes import Chart, mark, quantity, tooltip_texts
from shadowbench.reports.charts import INK_SIGNAL, chart_of
from shadowbench.reports.styles import COLORS
from shadowbench.reports.words import digits
from shadowbench.results.configurations import Configuration, Section
from shadowbench.results.curves import Curve, curves

_TICKS = (0.0, 0.001, 0.003, 0.01, 0.03, 0.1, 0.3, 1.0)
_LINEAR_BELOW = 1e-3  # the scale is linear below this share and logarithmic above, so that it includes 0


def bias_charts(section: Section) -> list[tuple[str, Chart]]:
    """Pairs of a swept spec and its chart; specs without values of acne and contact, and soft shadows, are left out."""
    found = curves(section.scored, section.run.sweep_positions)
    bases = dict.fromkeys(one.base for one in found)
    charts = [(base, _chart(section, base, [one for one in found if one.base == base])) for base in bases]
    return [(base, chart) for base, chart in charts if chart is not None]


def _chart(section: Section, base: str, found: list[Curve]) -> Chart | None:
    points = [point for curve in found for factor, one in curve.points if (point := _point(curve, factor, one))]
    if not points:
        return None
    maps = list(dict.fromkeys(point["map"] for point in points))
    x, y = _share(points, "x", "contact shadow lost (peter-panning)"), _share(points, "y", "acne")
    color = {
        "field": "map",
        "title": "map size",
        "scale": {"domain": maps, "range": [COLORS[at % len(COLORS)] for at in range(len(maps))]},
        "legend": {"orient": "top"} if len(maps) > 1 else None,
    }
    names = ("spec", "map", "× bias", "acne", "contact", section.ranked_by.error_label, "SSIM")
    tooltip = [{"field": name} for name in names]
    at = {"x": x, "y": y}
    best = {"condition": {"test": "datum.best", "value": INK_SIGNAL}, "value": None}
    point, label = {**at, "color": color, "stroke": best, "tooltip": tooltip}, {**at, "text": {"field": "× bias"}}
    layer: list[Chart] = [
        mark("line", {**at, "color": color, "order": {"field": "factor"}}, strokeWidth=1.5),
        mark("point", point, filled=True, size=70, strokeWidth=2),
        mark("text", label, align="left", dx=7, dy=-7, fontSize=11, color=INK_SIGNAL),
    ]
    return chart_of(f"Acne against contact of {base} in {section.title}", points, layer, 320)


def _point(curve: Curve, factor: float, one: Configuration) -> Chart | None:
    acne, contact = one.value("acne"), one.value("contact")
    if acne is None or contact is None or one.soft:
        return None
    return {
        **tooltip_texts(one),
        "acne": digits(acne),
        "contact": digits(contact),
        "× bias": f"×{factor:g}",
        "factor": factor,
        "best": factor == curve.best,
        "y": acne,
        "x": contact,
    }


def _share(points: list[Chart], field: str, title: str) -> Chart:
    most = max(point[field] for point in points)
    top = next((tick for tick in _TICKS if tick >= most and tick > _LINEAR_BELOW), 1.0)
    scale = {"type": "symlog", "constant": _LINEAR_BELOW, "domain": [0, top], "nice": False}
    axis = {"values": [tick for tick in _TICKS if tick <= top], "format": "~g", "grid": True}
    return quantity(field, title, scale=scale, axis=axis)
