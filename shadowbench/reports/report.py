"""Reports on run and sweep folders: an HTML page, Markdown tables, a CSV of all cells, or PNG charts."""

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from pathlib import Path

import pandas as pd
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.files import check_outputs, replace_file
from shadowbench.reports.along_axes import axis_figure
from shadowbench.reports.axes import Chart
from shadowbench.reports.charts import (
    bias_charts,
    default_size,
    front_chart,
    pass_chart,
    section_figure,
    size_chart,
    titled,
)
from shadowbench.reports.data_files import replaced_folder
from shadowbench.reports.heat_map import heat_map
from shadowbench.reports.html import html_report
from shadowbench.reports.markdown import markdown_report
from shadowbench.reports.stability import Stability, analyse
from shadowbench.reports.styles import styles_of
from shadowbench.reports.words import tolerances
from shadowbench.results.configurations import Section, specs_of
from shadowbench.results.folder import Run, Sweep
from shadowbench.results.ranges import points_frame

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


FORMATS = ("html", "md", "csv", "png")


def report_target(output: Path | None, form: str, split: bool = False) -> Path:
    """The output of a report in one of FORMATS: a file, or for png a folder; by default `report` with a suffix.

    Raises InputError for other formats, for one but html that is to be split, and if the output cannot be written.
    """
    if split and form != "html":
        raise InputError(f"--split: found --format {form:.60}; allowed: html, whose pictures it writes beside the page")
    if form not in FORMATS:
        raise InputError(f"--format: found {form!r:.60}; allowed: {', '.join(FORMATS)}")
    target = output or Path("report" if form == "png" else f"report.{form}")
    if form != "png":
        check_outputs(f".{form}", target)
        folder = files_beside(target)
        if split and folder.exists() and any(file.suffix != ".js" for file in folder.iterdir()):
            raise InputError(f"{folder}: found other files; --split replaces this folder, by one with the page's data")
    elif target.exists() and not target.is_dir():
        raise InputError(f"{target}: found a file; allowed: a folder, for the charts")
    return target


def write_report(
    runs: Sequence[Run],
    scenes: Mapping[str, Sequence[Section]],
    sweeps: Sequence[Sweep],
    target: Path,
    form: str,
    split: bool = False,
) -> int:
    """Write a report on runs and sweeps in one of FORMATS; returns the number of charts for png, else 0.

    scenes: `sections` of the runs; split: write the data of an HTML page into `files_beside`. Raises InputError.
    """
    swept = [analyse(sweep) for sweep in sweeps]
    if form == "png":
        return _write_figures(target, scenes, swept)
    with replaced_folder(files_beside(target)) if split else nullcontext() as beside:
        text = html_report(runs, scenes, swept, beside) if form == "html" else _text(form, runs, scenes, swept)
    with replace_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return 0


def files_beside(page: Path) -> Path:
    """Folder of the data of a page that is split: `report.files` for `report.html`."""
    return page.with_suffix(".files")


def _text(form: str, runs: Sequence[Run], scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> str:
    if form == "csv":
        return _all_cells(runs, swept).to_csv(index=False)
    return markdown_report(runs, scenes, swept)


def _all_cells(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: columns `run`, `processor`, `software`, then those of `table.csv`.

    Cells of a sweep also have `range`, the operating range along their axis.
    """
    tables = [(run, run.frame) for run in runs] + [(found.sweep, _points(found)) for found in swept]
    frames = [
        frame.assign(run=one.label, processor=one.about.get("machine", {}).get("processor"), software=one.software)
        for one, frame in tables
    ]
    columns = list(dict.fromkeys(name for frame in frames for name in frame))
    first = ["run", "processor", "software"]
    return pd.concat(frames)[[*first, *(name for name in columns if name not in first)]]


def _points(found: Stability) -> pd.DataFrame:
    rows = found.sweep.rows
    ranges = [found.range_at.get((row["home_spec"], row["axis"], row["light_kind"])) for row in rows]
    return points_frame(rows).assign(range=pd.Series([one and one.text for one in ranges], dtype=object))


def _write_figures(folder: Path, scenes: Mapping[str, Sequence[Section]], swept: Sequence[Stability]) -> int:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot be created ({error.strerror or error})") from error
    count = 0
    for name, picture in figures(scenes, swept):
        with replace_file(folder / name) as temporary:
            temporary.write_bytes(picture)
        count += 1
    return count
