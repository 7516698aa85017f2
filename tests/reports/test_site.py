"""The site of results: each row has an address and an origin, its data are described, and nothing leads outside."""

import csv
import html
import json
import re
import shutil
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from urllib.parse import parse_qs, unquote

import duckdb
import pytest
from PIL import Image

from shadowbench.measure.columns import described
from shadowbench.reports.site import write_site
from tests.engine_rows import ROWS
from tests.reports.conftest import CELLS, Cell, run_file, write_folder
from tests.test_docs import anchors

ROOT = Path(__file__).resolve().parents[2]
SOFT = Cell("shadow-map", 1024, 0.1, 9.0, scene="post", rmse_pen=0.1)
COMMIT = "0123456789"
LINK = re.compile(r'(?:href|src)="([^"]*)"')


def write_folders(folder: Path) -> list[Path]:
    """Folders of techniques, in a hard and a soft scene, and of engines; one mask is not kept."""
    techniques = [record | {"commit": COMMIT} for cell in (*CELLS, SOFT) for record in cell.records()]
    about = run_file(True, "A processor")
    of_engines = about | {"study": about["study"] | {"scenes": ["stairs", "street", "terrain"]}}
    folders = [
        write_folder(folder / "techniques", techniques, about, True),
        write_folder(folder / "engines", ROWS, of_engines, True),
    ]
    (folders[0] / "masks" / f"{CELLS[1].key}.png").unlink()
    return folders


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_folders(tmp_path_factory.mktemp("folders"))


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory, folders: list[Path]) -> Path:
    target = tmp_path_factory.mktemp("site")
    assert write_site(folders, target) == len(CELLS) + 1 + len(ROWS)
    return target


@pytest.fixture(scope="module")
def pages(site: Path) -> Mapping[str, str]:
    """The text of each page, by its path."""
    found = {file.relative_to(site).as_posix(): file.read_text(encoding="utf-8") for file in site.rglob("*.html")}
    assert {"index.html", "techniques.html", "engines.html", "yours.html", "scenes/stairs.html"} <= found.keys()
    return found


def row_of(page: str, key: str) -> str:
    """The text of a row."""
    return html.unescape(page.partition(f'<tr id="{key}">')[2].partition("</tr>\n")[0]).replace("<wbr>", "")


def test_every_row_has_one_address_with_its_spec_scores_and_origin(pages: Mapping[str, str]) -> None:
    for cell in CELLS:
        row = row_of(pages["scenes/stairs.html"], cell.key)
        for text in (cell.spec, f"{cell.spec}[{cell.map_size}]", cell.key, COMMIT, "#run-techniques", "a renderer"):
            assert text in row, text
        assert (f">{cell.error:.3g}"[:5] in row) if cell.error else (cell.status in row or ">0<" in row or "–" in row)
    ids = Counter(key for page in pages.values() for key in re.findall(r'<tr id="(\w+)"', page))
    assert ids == Counter([*(cell.key for cell in (*CELLS, SOFT)), *(row["key"] for row in ROWS)])


def test_a_row_says_how_it_is_measured_again(pages: Mapping[str, str]) -> None:
    row = row_of(pages["scenes/stairs.html"], CELLS[4].key)
    again = "shadowbench run stairs -t shadow-map:bias=none --map-size 512 --view-size 32 --phases 1 --rounds 0"
    assert f"<pre>{again}\n" in row and f"shadowbench repro {CELLS[4].key} --of " in row and "@misc{" in row
    assert "<pre>shadowbench engines install three\n" in row_of(pages["scenes/stairs.html"], ROWS[0]["key"])


def test_every_link_leads_to_a_file_and_a_place_in_it_and_none_outside(site: Path, pages: Mapping[str, str]) -> None:
    for name, page in pages.items():
        links = [html.unescape(link) for link in LINK.findall(page.partition('<script type="application/json"')[0])]
        assert "index.html" in " ".join(links)
        assert name != "engines.html" or "scenes/stairs.html" in links
        for link in links:
            assert not re.match(r"(\w+:)?//", link), link
            path, _, place = link.partition("#")
            file = (site / name).parent / unquote(path) if path else site / name
            if "docs/" in path:  # which Sphinx builds beside
                source = ROOT / path[path.index("docs/") :].replace(".html", ".md")
                assert source.exists() and (not place or place in anchors(source)), link
            elif not path.startswith("data:"):
                assert file.exists(), link
                text = file.read_text(encoding="utf-8") if place and file.suffix == ".html" else ""
                assert "=" in place or not place or f'id="{place}"' in text, link
        assert not re.search(r"url\((?!#)|@import", page.partition("<script")[0])


def test_every_page_names_command_commit_renderer_and_machine_of_its_figures(pages: Mapping[str, str]) -> None:
    for name in ("index.html", "techniques.html", "yours.html", "scenes/stairs.html", "scenes/post.html"):
        for text in ("shadowbench run stairs -t", COMMIT, "renderer of A processor", "A processor, 2 cores"):
            assert text in html.unescape(pages[name]), (name, text)


def test_the_first_page_compares_settings_by_scene_techniques_first(pages: Mapping[str, str]) -> None:
    table = pages["index.html"].partition('<table class="errors">')[2].partition("</table>")[0].replace("<wbr>", "")
    settings = re.findall(r'<th scope="row">([^<]*)</th>', table)
    assert settings[0] == "ray-traced" and settings[-1] == "three:preset=shipped,sides=closed at 1024"
    assert "shadow-map at 1024" in settings and "shadow-map at 512" not in settings
    assert f'<a class="some" href="scenes/stairs.html#{CELLS[2].key}">0.0200</a>' in table
    assert "post" not in table and 'href="scenes/post.html"' in pages["index.html"]
    assert '<figure class="front">' in pages["index.html"] and "<svg" in pages["index.html"]


def test_the_spread_of_a_setting_is_over_scenes_of_one_kind_of_light(pages: Mapping[str, str]) -> None:
    row = pages["yours.html"].partition("three:<wbr>preset=shipped,")[2].partition("</tr>")[0]
    found = re.findall(r'href="scenes/(\w+)[^>]*>(\S+) ', row)
    assert found == [("street", "0.100"), ("terrain", "0.200"), ("stairs", "0.500")] and "(3)" in row


def test_pictures_show_errors_and_lead_to_the_wipe(site: Path, pages: Mapping[str, str]) -> None:
    page = pages["scenes/stairs.html"]
    tile = page.partition(f"pictures/{CELLS[2].key}.webp")[0].rpartition('<a href="../techniques.html#')[2]
    chosen = parse_qs(html.unescape(tile.partition('"')[0]))
    assert chosen == {"scene": ["stairs, 32² view"], "left": ["shadow-map at 1024"], "right": ["truth"]}
    with Image.open(site / "pictures" / f"{CELLS[5].key}.webp") as image:
        assert image.size == (256, 256) and len(image.convert("RGB").getcolors(1 << 16) or ()) > 2
    assert f"{CELLS[1].key}.webp" not in page, "its mask is not kept"
    parts = json.loads(pages["techniques.html"].partition('id="page">')[2].partition("</script>")[0])
    assert parts["site"] is True


def test_data_are_the_same_in_both_formats_and_every_column_is_described(site: Path) -> None:
    with (site / "data" / "rows.csv").open(newline="", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    package = json.loads((site / "data" / "datapackage.json").read_text(encoding="utf-8"))
    fields = {field["name"]: field for field in package["resources"][0]["schema"]["fields"]}
    assert {name: field["description"] for name, field in fields.items()} == described(rows[0])
    assert len(rows) == len(CELLS) + 1 + len(ROWS) and {row["run"] for row in rows} == {"techniques", "engines"}
    stored = duckdb.read_parquet(str(site / "data" / "rows.parquet"))
    assert stored.columns == list(rows[0])
    types = {"BIGINT": "integer", "DOUBLE": "number", "BOOLEAN": "boolean", "VARCHAR": "string"}
    assert [types[str(kind)] for kind in stored.types] == [field["type"] for field in fields.values()]
    assert fields["map_size"]["type"] == "integer" and fields["iou"]["type"] == "number"
    for row, values in zip(rows, stored.fetchall(), strict=True):
        found = dict(zip(stored.columns, values, strict=True))
        assert found["key"] == row["key"] and found["iou"] == (float(row["iou"]) if row["iou"] else None)
        assert found["engine_version"] == (row["engine_version"] or None)


def test_a_site_written_again_has_no_rows_of_before(folders: list[Path], tmp_path: Path) -> None:
    write_site(folders, tmp_path)
    (tmp_path / "docs").mkdir()
    assert write_site(folders[1:], tmp_path) == len(ROWS)
    assert not (tmp_path / "scenes" / "post.html").exists() and (tmp_path / "docs").exists()
    with (tmp_path / "data" / "rows.csv").open(newline="", encoding="utf-8") as stream:
        assert len(list(csv.DictReader(stream))) == len(ROWS)


def test_a_folder_without_truth_has_no_pictures(folders: list[Path], tmp_path: Path) -> None:
    bare = shutil.copytree(folders[1], tmp_path / "engines")
    shutil.rmtree(bare / "truth")
    write_site([bare], tmp_path / "site")
    assert list((tmp_path / "site" / "pictures").iterdir()) == []


def test_the_first_page_names_a_cheapest_setting_by_times_of_a_gpu_alone(
    tmp_path: Path, pages: Mapping[str, str]
) -> None:
    records = [record for cell in CELLS for record in cell.records()]
    write_site([write_folder(tmp_path / "gpu", records, run_file(False, "A"), False)], tmp_path)
    assert "is the cheapest" in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "is the cheapest" not in pages["index.html"]
