"""The charts of a report as PNG figures for papers."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence

from PIL import Image

from shadowbench.reports.along_axes import axis_figure
from shadowbench.reports.axes import Chart
from shadowbench.reports.bias_curve import bias_charts
from shadowbench.reports.charts import default_size, front_chart, pass_chart, section_figure, size_chart, titled
from shadowbench.reports.heat_map import heat_map
from shadowbench.reports.stability import Stability
from shadowbench.reports.styles import styles_of
from shadowbench.reports.words import tolerances
from shadowbench.results.configurations import Section, specs_of

_SCALE = 2.5  # 760 units of width become 1900 pixels: 16 cm at 300 dots an inch
_CELL = 64  # width of a heat map's cell in units, enough for its text


def figures(scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> Iterator[tuple[str, bytes]]:
    """Generate (file name, PNG bytes) of every chart.

    Per section: SCENE.VIEW-SIZE.KIND.png, where KIND is front, sizes, passes, or bias-1, … for bias sweeps; per sweep:
    stability.png and stability.AXIS.png. With several runs or sweeps, their label comes before the last part.
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
                yield _file(f"{stem}.{kind}"), _png(section_figure(chart, section))
        for number, (base, chart) in enumerate(bias_charts(section), start=1):
            yield _file(f"{stem}.bias-{number}"), _png(titled(chart, section.title, f"bias of {base}, multiplied"))
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
    import vl_convert  # not on every platform

    return _compressed(vl_convert.vegalite_to_png(chart, scale=_SCALE))


def _compressed(png: bytes) -> bytes:
    """The same image without transparency and better compressed: about a fifth of the size."""
    file = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        image.convert("RGB").save(file, format="PNG", optimize=True, dpi=(72 * _SCALE, 72 * _SCALE))
    return file.getvalue()
