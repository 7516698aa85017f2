"""The site of results: static pages from run folders, in which each row has an address and each figure its origin."""

import re
import shutil
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, partial
from pathlib import Path
from statistics import median
from typing import Any

from markdown_it import MarkdownIt
from PIL import Image

from shadowbench.files import make_folder
from shadowbench.plugin.registry import engines
from shadowbench.reports import verdict, words
from shadowbench.reports.charts import front_chart
from shadowbench.reports.engines_page import write_engines_page
from shadowbench.reports.gallery import difference, read_facets, read_view
from shadowbench.reports.html import PAGE, environment
from shadowbench.reports.report import write_report
from shadowbench.reports.site_data import write_data
from shadowbench.reports.site_rows import MAP_SIZE, SiteRow, level, scene_file, site_rows
from shadowbench.reports.vega import Chart, styles_of
from shadowbench.results.configurations import Section, sections
from shadowbench.results.folder import Run, read_runs, view_name
from shadowbench.results.law import law_on_record
from shadowbench.results.ranking import mean_section
from shadowbench.scenes.library import builtin_about, builtin_light, builtin_names

TITLES = {"techniques": "Techniques", "plants": "Leaves and characters", "engines": "Engines"}
DOCS = {
    "docs/explanation/gallery.html": "Gallery",
    "docs/explanation/choosing.html": "Choosing",
    "docs/index.html": "Documentation",
}
"""Pages of the documentation, which is built beside, and their titles."""
_SIDE = 256  # pixels of a small picture
_MOST = 60  # settings that the first page compares
_TEXT = {"color": "currentColor", "labelColor": "currentColor", "titleColor": "currentColor"}


def write_site(folders: Sequence[Path], target: Path) -> int:
    """Write the site of run folders into a folder, and return its number of rows. Raises InputError.

    Its pages: the first, a report of each folder without engines, that of engines and of each defect of one, one of
    each scene, and how a reader's own results compare. Links to the documentation lead into `docs/` there.
    """
    runs = read_runs(folders)
    found = sections(runs, law_on_record())
    every = [section for parts in found.values() for section in parts]
    rows = site_rows(every)
    drawn = [run for run in runs if any(row.is_engine for row in rows if row.run is run)]
    pages = {f"{run.label}.html": TITLES.get(run.label, run.label) for run in runs if run not in drawn}
    pages |= {"engines.html": TITLES["engines"]} if drawn else {}
    site = _Site(target, {"index.html": "Results", **pages, "yours.html": "How wrong is yours?", **DOCS})
    for name in ("data", "scenes", "pictures"):
        shutil.rmtree(target / name, ignore_errors=True)
        make_folder(target / name)
    with ThreadPoolExecutor() as threads:
        pictures = {row for row in threads.map(partial(_picture, target / "pictures"), rows) if row is not None}
    for run in runs:
        if run not in drawn:
            parts = {title: of for title, all in found.items() if (of := [part for part in all if part.run is run])}
            file = f"{run.label}.html"
            write_report([run], parts, [], target / file, "html", split=True, nav=site.nav("", file))
    by_scene: dict[str, list[SiteRow]] = {}
    for row in rows:
        by_scene.setdefault(row.score["scene"], []).append(row)
    if drawn:
        _write_engines(drawn, by_scene, site)
    suns = [part for part in every if part.run not in drawn and _light(part.scene) == "directional" and part.scored]
    hard = {scene: of for scene, of in sorted(by_scene.items()) if not any(row.ranked_by.name == "rmse" for row in of)}
    site.write(
        "index.html",
        "site_index.html.j2",
        scenes=hard,
        others=sorted(by_scene.keys() - hard.keys()),
        matrix=_matrix(hard),
        fronts=_fronts(suns),
        hard=next((of for run in runs if run not in drawn and (of := _hard(every, run))), []),
        rows=rows,
        runs=runs,
    )
    for scene, several in by_scene.items():
        about = builtin_about(scene) if scene in builtin_names() else ""
        site.write(scene_file(scene), "site_scene.html.j2", scene=scene, about=about, rows=several, pictures=pictures)
    site.write("yours.html", "site_yours.html.j2", spread=_spread(hard), lights=_lights(hard), runs=runs)
    write_data(runs, target / "data")
    shutil.copyfile(PAGE / "report.css", target / "report.css")
    shutil.copyfile(PAGE / "site.css", target / "site.css")
    return len(rows)


class _Site:
    """Writes pages that share links to each other; pages: titles by file."""

    def __init__(self, target: Path, pages: Mapping[str, str]) -> None:
        self.target, self.pages = target, pages

    def nav(self, up: str, here: str) -> str:
        """Links to all pages from the page `here`; up: the way to the first page's folder."""
        return environment().get_template("site_nav.html.j2").render(pages=self.pages, up=up, here=here)

    def write(self, name: str, template: str, **given: Any) -> None:
        """Write a page; given: what its template shows."""
        up = "../" * name.count("/")
        shared = {"up": up, "words": words, "verdict": verdict, "level": level, "map_size": MAP_SIZE}
        page = environment().get_template(template).render(nav=self.nav(up, name), **shared, **given)
        (self.target / name).write_text(page, encoding="utf-8")


def _picture(folder: Path, row: SiteRow) -> SiteRow | None:
    """Write the difference of a row's mask from the truth, and return the row; None if either is not kept."""
    score, truth = row.score, row.run.folder / "truth"
    view = view_name(score)
    if row.mask is None or not (truth / f"{view}.undecided.png").exists():
        return None
    mask, right, undecided = (
        read_view(file, score["view_size"])
        for file in (row.mask, truth / f"{view}.png", truth / f"{view}.undecided.png")
    )
    facets = read_facets(truth / f"{view}.png", score["view_size"])
    image = Image.fromarray(difference(mask, right, undecided > 0, row.ranked_by.name == "rmse", facets))
    image.resize((_SIDE, _SIDE), Image.Resampling.BOX).save(folder / f"{score['key']}.webp", quality=70)
    return row


def _write_engines(runs: Sequence[Run], scenes: Mapping[str, Sequence[SiteRow]], site: _Site) -> None:
    """Write the page of engines, with a place of each, and one of each defect; their pictures are written beside."""
    file = site.target / "engines.md"
    shutil.rmtree(file.with_suffix(""), ignore_errors=True)
    names = [one.engine.name for one in write_engines_page(runs, dict.fromkeys(engines(), "not measured"), file)]
    text = re.sub(rf"(<th[^>]*>)({'|'.join(map(re.escape, scenes))})(?=</th>)", _scene_link, _text(file))
    file.unlink()
    text = re.sub(r"<h3>(.*?)</h3>", r'<h3 id="\1">\1</h3>', text)
    text = re.sub(rf"(<tr>\s*<td>)({'|'.join(names)})(?=</td>)", r'\1<a href="#\2">\2</a>', text)
    text = re.sub(r'"(engines/\w+-defect)(\.md|/README\.md)"', r'"\1.html"', text)
    page = partial(site.write, template="site_text.html.j2", runs=runs)
    page("engines.html", text=text, title=TITLES["engines"], engines=names, files=())
    places = {row.score["key"]: row.address for rows in scenes.values() for row in rows}
    for defect in sorted(file.with_suffix("").glob("*-defect.md")):
        text = re.sub(r"row <code>(\w+)</code>", lambda row: _row_link(row, places), _text(defect))
        files = [defect.name, *sorted(f"{defect.stem}/{one.name}" for one in defect.with_suffix("").iterdir())]
        title = defect.read_text(encoding="utf-8").splitlines()[0].lstrip("# ")
        page(f"engines/{defect.stem}.html", text=text, title=title, engines=(), files=files)


def _text(file: Path) -> str:
    """A file of Markdown as HTML, its tables as wide as they need."""
    text = str(MarkdownIt().enable("table").render(file.read_text(encoding="utf-8")))
    table = '<div class="wide" tabindex="0" role="region" aria-label="Table"><table class="plain">'
    text = re.sub(r"<code>[^<]*", lambda found: re.sub(r"([,:(])", r"\1<wbr>", found[0]), text)
    return text.replace("<table>", table).replace("</table>", "</table></div>")


def _row_link(row: re.Match[str], places: Mapping[str, str]) -> str:
    return f'row <a href="../{places[row[1]]}"><code>{row[1]}</code></a>'


def _scene_link(heading: re.Match[str]) -> str:
    return f'{heading[1]}<a href="{scene_file(heading[2])}">{heading[2]}</a>'


def _matrix(scenes: Mapping[str, Sequence[SiteRow]]) -> list[tuple[str, dict[str, SiteRow]]]:
    """The settings that are compared, and the row of each by scene: techniques first, the least median error first."""
    found: dict[str, dict[str, SiteRow]] = {}
    for scene, rows in scenes.items():
        for row in rows:
            if row.compared:
                found.setdefault(row.name, {}).setdefault(scene, row)
    scored = [(name, of) for name, of in found.items() if any(row.error is not None for row in of.values())]

    def order(item: tuple[str, Mapping[str, SiteRow]]) -> tuple[bool, float]:
        rows = item[1].values()
        return next(iter(rows)).is_engine, median(row.error for row in rows if row.error is not None)

    return sorted(scored, key=order)[:_MOST]


def _fronts(parts: Sequence[Section]) -> list[tuple[str, str]]:
    """Error against time, of each run that was timed, over its scenes with a sun: a caption and SVG."""
    charts = []
    for run in dict.fromkeys(part.run for part in parts):
        of = [part for part in parts if part.run is run]
        mean = mean_section(of, f"{len(of)} scenes with a sun")
        chart = front_chart(mean, styles_of(one.spec for one in mean.scored))
        if chart is not None:
            charts.append(
                (f"{TITLES.get(run.label, run.label)}: {mean.title}; {words.cost_source(mean)}", _svg(chart, run.label))
            )
    return charts


def _svg(chart: Chart, name: str) -> str:
    """A chart in the colours of the page around it; name: unique on the page."""
    import vl_convert  # not on every platform

    colors = {"ink": "currentColor", "paper": "var(--paper)"}
    config = chart["config"] | {"background": None}
    config |= {name: config[name] | _TEXT for name in ("axis", "legend")}
    config["axis"] |= {"gridColor": "var(--rule)"}
    config["legend"] |= {"columnPadding": 60}  # a browser's letters may be wider than those that were measured
    params = [param | {"value": colors[param["name"]]} for param in chart["params"]]
    svg = vl_convert.vegalite_to_svg({**chart, "width": 760, "params": params, "config": config})
    return re.sub(r'( id="|url\(#)', rf"\g<1>{name}-", svg)


def _hard(every: Sequence[Section], run: Run) -> list[Section]:
    return [part for part in every if part.run is run and part.scored and not part.soft]


@cache
def _light(scene: str) -> str:
    """The kind of light of a built-in scene; nothing of another."""
    return builtin_light(scene) if scene in builtin_names() else ""


def _lights(scenes: Mapping[str, Any]) -> list[str]:
    return sorted({light for scene in scenes if (light := _light(scene))})


def _spread(scenes: Mapping[str, Sequence[SiteRow]]) -> list[tuple[str, dict[str, list[SiteRow]]]]:
    """The settings that are compared, and the scored rows of each by kind of light, least error first."""
    found = []
    for name, of in _matrix(scenes):
        by_light: dict[str, list[SiteRow]] = {}
        for row in sorted((row for row in of.values() if row.error is not None), key=lambda row: row.error or 0.0):
            by_light.setdefault(_light(row.score["scene"]), []).append(row)
        found.append((name, by_light))
    return found
