"""The report of a run and a sweep in a real browser: charts, interaction, and no network access."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from playwright.sync_api import Locator, Page

from shadowbench.reports.report import write_report
from shadowbench.results.frame import read_folders
from shadowbench.results.summary import summaries
from shadowbench.scores.difference import FACETS, FALSE_LIGHT
from tests.reports.browsing import visiting
from tests.reports.conftest import CELLS, POINTS, Cell, run_file, write_folder

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

FILTERS = ("shadow-map", "shadow-map:filter=pcss", "shadow-map:filter=msm(blur=9)")
KNOWN = (
    *CELLS,
    *(replace(cell, scene="terrace") for cell in CELLS if cell.spec != "ray-traced"),
    *(Cell(f"shadow-map:filter=pcf(taps={taps})", 512, 0.1 + taps / 100, 3.0 + taps) for taps in range(2, 9)),
    *(Cell(spec, 512, 0.1, 9.0 + index, scene="post", rmse_pen=0.1 + index) for index, spec in enumerate(FILTERS)),
)
"""Two hard scenes, one with more specs than a chart shows, and a soft one."""
STAIRS = "stairs, 32² view"


def write_page(page: Path) -> Path:
    """The report on a run with these cells and a sweep of `stress`."""
    rows = {"run": [row for cell in KNOWN for row in cell.records()], "sweep": [point.record() for point in POINTS]}
    folders = [write_folder(page.parent / name, rows[name], run_file(True, "A"), True) for name in rows]
    runs, sweeps = read_folders(folders)
    write_report([(run, summaries(run)) for run in runs], sweeps, page, "html")
    return page


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    return write_page(tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture
def page(browser, report) -> Iterator[Page]:
    """The report, with its scene of more specs than a chart shows."""
    with visiting(browser, report) as opened:
        choose_scene(opened, STAIRS)
        yield opened


def marks(chart: Locator, kind: str = "symbol") -> Locator:
    return chart.locator(f".mark-{kind}.role-mark path")


def choose_scene(page: Page, title: str) -> None:
    """Show a scene and wait until it is drawn."""
    page.locator("#scene").select_option(label=title)
    page.evaluate("window.drawn")


def choose(select: Locator, start: str) -> None:
    """Choose the option that starts with a text."""
    select.select_option(label=next(one for one in select.locator("option").all_inner_texts() if one.startswith(start)))


def pixels(canvas: Locator) -> list[tuple[int, ...]]:
    """(r, g, b) of every pixel of a canvas."""
    read = canvas.evaluate(
        """node => {
            const copy = Object.assign(document.createElement("canvas"), { width: node.width, height: node.height });
            copy.getContext("2d").drawImage(node, 0, 0);
            const { data } = copy.getContext("2d").getImageData(0, 0, node.width, node.height), found = [];
            for (let at = 0; at < data.length; at += 4) found.push([...data.slice(at, at + 3)]);
            return found;
        }"""
    )
    return [tuple(one) for one in read]


def settled(page: Page) -> None:
    """Wait until both sides of the first viewer are drawn."""
    page.evaluate("first.done")


def told(page: Page, mark: Locator) -> str:
    """The text of a mark's tooltip."""
    mark.scroll_into_view_if_needed()
    mark.hover(force=True)
    tooltip = page.locator("#vg-tooltip-element.visible")
    tooltip.wait_for(timeout=5000)
    return tooltip.inner_text()


# The answer


def test_the_first_screen_has_the_answer_the_matrix_and_a_picture(browser, report) -> None:
    with visiting(browser, report) as page:
        verdict = page.locator(".verdict:visible p").first
        assert "of the shadow right in all 2 scenes" in verdict.inner_text() and "ms a frame" in verdict.inner_text()
        for part in (verdict, page.locator(".matrix:visible"), page.locator("#viewer .stage")):
            box = part.bounding_box()
            assert box is not None and box["y"] >= 0 and box["y"] + min(box["height"], 400) <= 900
        before = page.locator("#table tbody").inner_text()
        choose_scene(page, STAIRS)
        assert "in all 2 scenes" not in page.locator(".verdict:visible p").first.inner_text()
        assert page.locator("#table tbody").inner_text() != before
        assert page.locator(".verdict:visible").count() == page.locator(".matrix:visible").count() == 1
        assert page.locator("#scene-shown").inner_text() == STAIRS


# Charts


def test_every_chart_is_drawn_with_all_of_its_points_inside(page) -> None:
    for title in page.locator("#scene option").all_inner_texts()[1:]:
        choose_scene(page, title)
        for kind, mark in (("front", "symbol"), ("sizes", "symbol"), ("passes", "rect")):
            chart = page.locator(f".chart.{kind}")
            assert marks(chart, mark).count() >= 3
            frame = chart.locator("svg").bounding_box()
            assert frame is not None and frame["width"] > 300 and frame["height"] > 100
            for one in marks(chart).all():
                box = one.bounding_box()
                assert box is not None
                assert frame["x"] <= box["x"] and box["x"] + box["width"] <= frame["x"] + frame["width"]
                assert frame["y"] <= box["y"] and box["y"] + box["height"] <= frame["y"] + frame["height"]


def test_a_point_tells_what_it_is_and_a_click_shows_its_picture(page) -> None:
    point = marks(page.locator(".chart.front")).last
    said = told(page, point)
    for name in ("full spec", "1 − IoU", "edge px", "time", "× reference", "ms, IQR"):
        assert name in said
    spec = point.evaluate("node => node.__data__.datum.spec")
    point.click(force=True)
    settled(page)
    assert page.locator("#viewer .tag.a").inner_text().startswith(spec)


def test_eight_specs_at_most_are_shown_each_with_a_look_of_its_own(page) -> None:
    legend = page.locator("#charts .legend")
    on, off = legend.locator("[aria-pressed=true]"), legend.locator("[aria-pressed=false]")
    drawn = """element => element.view.data("source_0").filter((one) => one.shown)
        .map((one) => [one.spec, [one.color, one.shape]])"""

    def looks() -> dict[str, tuple[str, str]]:
        """Colour and shape of the points, by spec."""
        return {spec: tuple(look) for spec, look in page.locator(".chart.sizes").evaluate(drawn)}

    assert on.count() == 8 and off.count() > 0 and off.first.is_disabled()
    before = looks()
    for part in (0, 1):
        assert len({look[part] for look in before.values()}) == len(before) > 3
    turned_off, turned_on = on.nth(2).get_attribute("data-spec"), off.first.get_attribute("data-spec")
    on.nth(2).press("Enter")
    page.locator(f"#charts .legend [data-spec='{turned_on}']").press("Enter")
    page.wait_for_timeout(500)
    after = looks()
    assert turned_off not in after and turned_on in after and on.count() == 8
    assert all(after[spec] == look for spec, look in before.items() if spec in after), "a look stays with its spec"


# The wipe


def test_the_wipe_is_moved_by_slider_and_drag(page) -> None:
    box = page.locator("#viewer")
    slider, stage = box.get_by_role("slider"), box.locator(".stage")
    right, cut = box.locator(".layer.right"), "node => getComputedStyle(node).clipPath"
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert slider.input_value() == "60" and "60%" in right.evaluate(cut)
    frame = stage.bounding_box()
    assert frame is not None
    page.mouse.move(frame["x"] + 0.6 * frame["width"], frame["y"] + 50)
    page.mouse.down()
    page.mouse.move(frame["x"] + 0.25 * frame["width"], frame["y"] + 50)
    page.mouse.up()
    assert float(slider.input_value()) == pytest.approx(25, abs=1) and "25" in right.evaluate(cut)
    page.mouse.move(frame["x"] + 0.9 * frame["width"], frame["y"] + 50)
    assert float(slider.input_value()) == pytest.approx(25, abs=1), "the drag has ended"


def test_any_two_can_be_wiped_as_shaded_as_mask_or_as_difference(page) -> None:
    box = page.locator("#viewer")
    left, right = box.locator("select.a"), box.locator("select.b")
    choose(left, "unshadowed")
    choose(right, "ray-traced")
    settled(page)
    a, b = box.locator("canvas.a"), box.locator("canvas.b")
    assert [box.locator(f".tag.{side}").inner_text() for side in "ab"] == ["unshadowed", "ray-traced"]
    seen = {}
    for mode in ("shaded", "mask", "difference"):
        box.get_by_role("radio", name=mode).check()
        settled(page)
        seen[mode] = (pixels(a), pixels(b))
        assert seen[mode][0] != seen[mode][1]
    assert len({tuple(left) for left, _ in seen.values()}) == 3
    # What is lit everywhere is of another colour where the truth has a shadow, and false light there.
    shaded, difference = seen["shaded"], seen["difference"]
    shadow = [at for at, color in enumerate(seen["mask"][1]) if color == (0, 0, 0)]
    assert len(shadow) == 16 * 16
    assert all(shaded[0][at] != shaded[1][at] and difference[0][at] == FALSE_LIGHT for at in shadow)
    choose(left, "ray-traced")
    right.select_option(label="truth (ray traced)")
    settled(page)
    assert FALSE_LIGHT not in pixels(b), "the truth has no error"
    # Dark facets are purple in every mask that is dark there, the truth's too, and the legend says so.
    assert pixels(a).count(FACETS) == pixels(b).count(FACETS) == 4 * 16 and FACETS not in difference[0]
    assert box.get_by_text("dark facets of smooth surfaces").is_visible()


# The table


def test_the_table_is_sorted_by_any_column_both_ways(page) -> None:
    table = page.locator("#table table")

    def column(index: int) -> list[float]:
        texts = table.locator(f"tbody tr td:nth-of-type({index})").all_inner_texts()
        return [float(text.strip("~").split()[0]) for text in texts if text not in ("", "–")]

    for name, index in (("cost, ms", 1), ("map", 2), ("1 − IoU", 3)):
        button = table.locator("thead button", has_text=name)
        button.press("Enter")
        rising = column(index)
        assert rising == sorted(rising) and len(rising) > 8
        assert table.locator("th[aria-sort=ascending]").inner_text().startswith(name)
        button.press("Enter")
        assert column(index) == rising[::-1]


# The page as a whole


def test_every_control_is_reached_by_keys_and_named(page) -> None:
    nameless = page.evaluate(
        """[...document.querySelectorAll("button, select, input, summary, a")]
        .filter(node => !node.hidden && !node.disabled && !node.closest("[hidden]"))
        .filter(node => node.tabIndex < 0
            || !(node.textContent.trim() || node.ariaLabel || node.labels?.[0]?.textContent.trim()))
        .map(node => node.outerHTML.slice(0, 200))"""
    )
    assert nameless == []
    assert page.evaluate("[...document.images].filter(image => !image.hasAttribute('alt')).length") == 0
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


# The sweep


def test_a_breaking_point_shows_its_picture(page) -> None:
    box = page.locator("#stability .viewer")
    box.locator("select.view").select_option("map-size 16 texels, sun")
    assert box.locator(".tag.a").inner_text() == "shadow-map" and box.locator(".tag.b").inner_text() == "truth"
    assert "leak" in box.locator(".caption.a").inner_text()
    assert re.search(r"shadowbench view \S+ --cell [0-9a-f]{24}$", box.locator(".caption.a").inner_text())
    choose(box.locator("select.view"), "elevation 50°")
    box.get_by_role("radio", name="difference").check()
    page.wait_for_timeout(500)
    assert pixels(box.locator("canvas.a")) != pixels(box.locator("canvas.b"))
