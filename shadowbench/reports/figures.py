"""The charts as PNG files, for papers."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence

import vl_convert
from PIL import Image

from shadowbench.reports.analysis import Section
from shadowbench.reports.charts import default_size, figure, front_chart, pass_chart, size_chart
from shadowbench.reports.styles import styles_of

_SCALE = 2.5  # 760 units of width become 1900 pixels: 16 cm at 300 dots an inch


def figures(scenes: Mapping[str, Sequence[Section]]) -> Iterator[tuple[str, bytes]]:
    """File name and PNG of every chart: SCENE.VIEW-SIZE.front.png, .sizes.png, .passes.png.

    Where there are several runs, the run's label stands before the kind.
    """
    every = [section for parts in scenes.values() for section in parts]
    several = len({section.run.label for section in every}) > 1
    styles = styles_of(every, legend=True)
    for section in every:
        stem = section.file_stem + (f".{section.run.label}" if several else "")
        for kind, chart in (
            ("front", front_chart(section, styles)),
            ("sizes", size_chart(section, styles)),
            ("passes", pass_chart(section, default_size(section))),
        ):
            if chart is not None:
                name = re.sub(r"[^\w.-]+", "_", f"{stem}.{kind}").strip("_") + ".png"
                yield name, _small(vl_convert.vegalite_to_png(figure(chart, section), scale=_SCALE))


def _small(png: bytes) -> bytes:
    """The same picture in a fifth of the bytes: without transparency, and packed with more care."""
    file = io.BytesIO()
    with Image.open(io.BytesIO(png)) as image:
        image.convert("RGB").save(file, format="PNG", optimize=True, dpi=(72 * _SCALE, 72 * _SCALE))
    return file.getvalue()
