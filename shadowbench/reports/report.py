"""Reports on run and sweep folders: an HTML page, tables, a CSV of all cells, or figures."""

import hashlib
import io
import json
import re
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

import pandas as pd
from PIL import Image

from shadowbench.errors import InputError
from shadowbench.files import check_outputs, make_folder, replace_file
from shadowbench.reports.charts import bias_charts, default_size, front_chart, pass_chart, size_chart
from shadowbench.reports.gallery import Place
from shadowbench.reports.html import Scenes, html_report
from shadowbench.reports.latex import latex_tables
from shadowbench.reports.markdown import escaped, markdown_report
from shadowbench.reports.stability import Stability, analyse, tolerances
from shadowbench.reports.strips import Strip, strip_of
from shadowbench.reports.sweep_charts import CELL, axis_figure, heat_map
from shadowbench.reports.vega import Chart, styles_of, titled
from shadowbench.reports.words import cost_source, section_notes, sentence
from shadowbench.results.configurations import specs_of
from shadowbench.results.folder import Run, Sweep
from shadowbench.results.ranges import points_frame
from shadowbench.results.tables import csv_of
from shadowbench.scores.difference import write_difference

FIGURES = ("png", "svg", "pdf")
FORMATS = ("html", "md", "csv", "tex", *FIGURES)
_COLORS = "colour: the share of an axis' values in tolerance"
_SCALE = 2.5  # 760 units of width become 1900 pixels: 16 cm at 300 dots an inch


def report_target(output: Path | None, form: str, split: bool = False) -> Path:
    """The output of a report in one of FORMATS: a file, or for FIGURES a folder; by default `report` with a suffix.

    Raises InputError for other formats, for one but html that is to be split, and if the output cannot be written.
    """
    if split and form != "html":
        raise InputError(f"--split: found --format {form:.60}; allowed: html, whose pictures it writes beside the page")
    if form not in FORMATS:
        raise InputError(f"--format: found {form!r:.60}; allowed: {', '.join(FORMATS)}")
    target = output or Path("report" if form in FIGURES else f"report.{form}")
    if form not in FIGURES:
        check_outputs(f".{form}", target)
        folder = _files_beside(target)
        if split and folder.exists() and any(file.suffix != ".js" for file in folder.iterdir()):
            raise InputError(f"{folder}: found other files; --split replaces this folder, by one with the page's data")
    elif target.exists() and not target.is_dir():
        raise InputError(f"{target}: found a file; allowed: a folder, for the figures")
    return target


def write_report(
    runs: Sequence[Run],
    scenes: Scenes,
    sweeps: Sequence[Sweep],
    target: Path,
    form: str,
    split: bool = False,
    pictures: Sequence[str] = (),
    nav: str = "",
) -> int:
    """Write a report on runs and sweeps in one of FORMATS; returns the number of figures for FIGURES, else 0.

    scenes: `sections` of the runs; split: write the data of an HTML page into a folder beside it; pictures: labels of
    configurations in strips of pictures (`strip_of`); nav: HTML of links to the other pages of a site that the page is
    one of. Raises InputError.
    """
    swept = [analyse(sweep) for sweep in sweeps]
    if form in FIGURES:
        return _write_figures(target, scenes, swept, form, pictures)
    if form == "html":
        beside = _files_beside(target)
        data: AbstractContextManager[Place] = _data_files(beside) if split else nullcontext(lambda _, value: value)
        with data as place:
            text = html_report(runs, scenes, swept, place, beside.name if split else None, nav)
    else:
        texts = {"csv": lambda: csv_of(all_cells(runs, swept)), "tex": lambda: latex_tables(scenes)}
        text = texts.get(form, lambda: markdown_report(runs, scenes, swept))()
    with replace_file(target) as temporary:
        temporary.write_text(text, encoding="utf-8", errors="backslashreplace")
    return 0


def _files_beside(page: Path) -> Path:
    """Folder of the data of a page that is split: `report.files` for `report.html`."""
    return page.with_suffix(".files")


@contextmanager
def _data_files(folder: Path) -> Iterator[Place]:
    """Yield a function that writes a value into a script; these replace those of the folder if no error occurs.

    A page that is opened from a disk may run scripts beside it, but read no other files there: each script calls
    `deliver` with its name and its value. Equal texts that name a value share a file.
    """
    beside = folder.with_name(f".{folder.name}.{secrets.token_hex(6)}")
    beside.mkdir(parents=True)

    def write(identity: str, value: Any) -> str:
        file = f"{hashlib.sha256(identity.encode(errors='replace')).hexdigest()[:16]}.js"
        name = f"{folder.name}/{file}"
        (beside / file).write_text(f"deliver({json.dumps(name)}, {json.dumps(value)});\n", encoding="utf-8")
        return name

    try:
        yield write
        shutil.rmtree(folder, ignore_errors=True)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)


def all_cells(runs: Sequence[Run], swept: Sequence[Stability]) -> pd.DataFrame:
    """The cells of all folders: columns `run`, `processor`, `software`, then those of `table.csv`.

    Cells of a sweep also have `range`, the operating range along their axis.
    """
    tables: list[tuple[Run | Sweep, pd.DataFrame]] = [(run, run.frame) for run in runs]
    for found in swept:
        keys = [(row["home_spec"], row["axis"], row["light_kind"]) for row in found.sweep.rows]
        ranges = [found.range_at[key].text if key in found.range_at else None for key in keys]
        tables.append((found.sweep, points_frame(found.sweep.rows).assign(range=pd.Series(ranges, dtype=object))))
    frames = [
        frame.assign(run=one.label, processor=one.about.get("machine", {}).get("processor"), software=one.software)
        for one, frame in tables
    ]
    first = ["run", "processor", "software"]
    columns = dict.fromkeys([*first, *(name for frame in frames for name in frame)])
    return pd.concat(frames)[list(columns)]


def _write_figures(folder: Path, scenes: Scenes, swept: Sequence[Stability], form: str, pictures: Sequence[str]) -> int:
    """Write charts in one of FIGURES, with their titles in png alone, strips as PNG, and `captions.md`."""
    make_folder(folder)
    captions = []
    for name, chart in figures(scenes, swept):
        heading = chart["title"]
        write_chart(folder / f"{_file_stem(name)}.{form}", chart if form == "png" else chart | {"title": None})
        captions.append((f"{_file_stem(name)}.{form}", ". ".join([chart["description"], *heading["subtitle"]]) + "."))
    for name, strip in _strips(scenes, pictures):
        file = f"{_file_stem(name)}.png"
        write_difference(folder / file, strip.picture)
        captions.append((file, strip.caption))
    with replace_file(folder / "captions.md") as temporary:
        temporary.write_text("".join(f"**{file}**: {escaped(text)}\n\n" for file, text in captions), encoding="utf-8")
    return len(captions)


def _file_stem(name: str) -> str:
    return re.sub(r"[^\w.-]+", "_", name).strip("_")


def write_chart(file: Path, chart: Chart) -> None:
    """Write a Vega-Lite chart as .svg or .pdf, else as PNG."""
    import vl_convert  # not on every platform

    with replace_file(file) as temporary:
        if file.suffix == ".svg":
            temporary.write_text(vl_convert.vegalite_to_svg(chart), encoding="utf-8")
        elif file.suffix == ".pdf":
            temporary.write_bytes(vl_convert.vegalite_to_pdf(chart))
        else:
            with Image.open(io.BytesIO(vl_convert.vegalite_to_png(chart, scale=_SCALE))) as image:
                # Without transparency and better compressed, about a fifth of the size.
                image.convert("RGB").save(temporary, format="PNG", optimize=True, dpi=(72 * _SCALE, 72 * _SCALE))


def _strips(scenes: Scenes, pictures: Sequence[str]) -> Iterator[tuple[str, Strip]]:
    """Generate (SCENE.VIEW-SIZE.strip, strip) of every section with pictures."""
    every = [section for parts in scenes.values() for section in parts]
    several = len({section.run.label for section in every}) > 1
    for section in every:
        if section.scored and (strip := strip_of(section, pictures)):
            yield f"{section.file_stem}{f'.{section.run.label}' if several else ''}.strip", strip


def figures(scenes: Scenes, swept: Sequence[Stability]) -> Iterator[tuple[str, Chart]]:
    """Generate (name, chart) of every figure.

    Per section: SCENE.VIEW-SIZE.KIND, where KIND is front, sizes, passes, or bias-1, … for bias sweeps; per sweep:
    stability and stability.AXIS. With several runs or sweeps, their label comes before the last part.
    """
    every = [section for parts in scenes.values() for section in parts]
    several = len({section.run.label for section in every}) > 1
    styles = styles_of(specs_of(every))
    for section in every:
        stem = section.file_stem + (f".{section.run.label}" if several else "")
        notes = (sentence(note).removesuffix(".") for note in section_notes(section))
        about = f"{section.run.renderer}; {cost_source(section)}", *notes
        for kind, chart in (
            ("front", front_chart(section, styles)),
            ("sizes", size_chart(section, styles)),
            ("passes", pass_chart(section, default_size(section))),
        ):
            if chart is not None:
                yield f"{stem}.{kind}", titled(chart, section.title, *about)
        for number, (spec, chart) in enumerate(bias_charts(section).items(), start=1):
            yield f"{stem}.bias-{number}", titled(chart, section.title, f"bias of {spec}, multiplied", *about)
    for found in swept:
        stem = "stability" + (f".{found.sweep.label}" if len(swept) > 1 else "")
        styles = styles_of(found.specs)
        about = found.sweep.renderer, f"tolerance: {tolerances()}"
        if found.ranges:
            yield (
                stem,
                titled(
                    heat_map(found), "Operating range along each axis", *about, _COLORS, width=CELL * len(found.axes)
                ),
            )
        for axis in found.axes:
            chart = axis_figure(found, axis, styles)
            yield f"{stem}.{axis.name}", titled(chart, f"{axis.name}: {axis.invariant}", *about, width=None)
