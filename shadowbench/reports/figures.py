"""The charts as PNG files, for papers."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence

import vl_convert
from PIL import Image

from shadowbench.reports.along_axes import axis_figure
from shadowbench.reports.analysis import Section, specs_of
from shadowbench.reports.axes import Chart
from shadowbench.reports.bias_curve import bias_charts
from shadowbench.reports.charts import default_size, figure, front_chart, pass_chart, size_chart, titled
from shadowbench.reports.heat_map import heat_map
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import styles_of
from shadowbench.reports.words import tolerances

_SCALE = 2.5  # 760 units of width become 1900 pixels: 16 cm at 300 dots an inch
_CELL = 64  # units of a heat map's cell, in which its text has room


def figures(scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> Iterator[tuple[str, bytes]]:
    """File name and PNG of every chart.

    SCENE.VIEW-SIZE.front.png, .sizes.png, .passes.png, of each bias that was swept .bias-1.png, and where there are
    several runs the run's label before the kind; of a sweep stability.png and stability.AXIS.png, with its label
    likewise.
    """
    every = [section for parts in scenes.values() for section in parts]
    several = len({section.run.label for section in every}) > 1
    styles = styles_of(specs_of(every), legend=True)
    for section in every:
        stem = section.file_stem + (f".{section.run.label}" if several else "")
        for kind, chart in (
            ("front", front_chart(section, styles)),
            ("sizes", size_chart(section, styles)),
            ("passes", pass_chart(section, default_size(section))),
        ):
            if chart is not None:
                yield _file(f"{stem}.{kind}"), _png(figure(chart, section))
        for number, (home, chart) in enumerate(bias_charts(section), start=1):
            yield _file(f"{stem}.bias-{number}"), _png(titled(chart, section.title, f"bias of {home}, multiplied"))
    for found in swept:
        stem = "stability" + (f".{found.sweep.label}" if len(swept) > 1 else "")
        styles = styles_of(found.specs, legend=True)
        about = (found.sweep.renderer, f"tolerance: {tolerances()}")
        if found.ranges:
            chart = titled(heat_map(found), "Operating range along each axis", *about, width=_CELL * len(found.axes))
            yield _file(stem), _png(chart)
        for axis in found.axes:
            chart = titled(axis_figure(found, axis, styles), f"{axis.name}: {axis.invariant}", *about, width=None)
            yield _file(f"{stem}.{axis.name}"), _png(chart)


def _file(name: str) -> str:
    return re.sub(r"[^\w.-]+", "_", name).strip("_") + ".png"


def _png(chart: Chart) -> bytes:
    return _small(vl_convert.vegalite_to_png(chart, scale=_SCALE))


def _small(png: bytes) -> bytes:
    """The same picture in a fifth of the bytes: without transparency, and packed with more care."""
    file = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        image.convert("RGB").save(file, format="PNG", optimize=True, dpi=(72 * _SCALE, 72 * _SCALE))
    return file.getvalue()
