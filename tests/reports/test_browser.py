"""The report of a run and a sweep in a real browser: charts, interaction, print, and no network access."""

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, Request, Route, sync_playwright

from shadowbench.scores.difference import FALSE_LIGHT
from tests.reports.conftest import CELLS, Cell

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

SCENES = ("cube-on-plane", "colonnade", "lamp-over-table")
SPECS = (
    *("unshadowed", "ray-traced", "shadow-map", "shadow-map:bias=none", "shadow-map:preset=course"),
    *("shadow-map:preset=offset", "cascades", "cube-map", "shadow-volume", "planar-projection"),
)
AXES = ("elevation", "map-size", "camera-step")
LARGEST = 8e6  # bytes


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report on a small study and a small sweep, written by the commands."""
    folder = tmp_path_factory.mktemp("report")
    shadowbench = [sys.executable, "-m", "shadowbench"]
    # Each cell is timed thrice in place of nine times: nothing here depends on how well.
    specs = [word for spec in SPECS for word in ("-t", spec)]
    study = [*SCENES, *specs, "--map-size", "512,1024,2048", "--rounds", "3"]
    subprocess.run([*shadowbench, "run", *study, "-o", folder / "run", "--quiet"], check=True)
    axes = [word for name in AXES for word in ("--axis", name)]
    specs = ["-t", "shadow-map", "-t", "planar-projection", "-t", "cube-map"]
    subprocess.run([*shadowbench, "stress", "--quick", *specs, *axes, "-o", folder / "sweep", "--quiet"], check=True)
    subprocess.run([*shadowbench, "report", folder / "run", folder / "sweep", "-o", folder / "report.html"], check=True)
    return folder / "report.html"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    """Debian's Chromium; `make test-slow` installs it."""
    chromium = shutil.which("chromium")
    assert chromium, "no chromium on the path; `tools/setup.sh chromium` installs it"
    with sync_playwright() as playwright:
        # A container's root has no sandbox to give; the page is ours.
        opened = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield opened
        opened.close()


@dataclass
class Visit:
    """An open page, its console messages and errors, and the URLs it requested."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture
def visit(browser: Browser, report: Path) -> Iterator[Callable[..., Visit]]:
    """Opens the report and waits until its charts are drawn; errors and network requests fail the test."""
    visits: list[Visit] = []

    def open_at(width: int = 1280, height: int = 900) -> Visit:
        one = Visit(browser.new_page(viewport={"width": width, "height": height}))
        visits.append(one)

        def refuse(route: Route, request: Request) -> None:
            if request.url == report.as_uri():
                route.continue_()
            else:
                one.asked.append(request.url)
                route.abort()

        one.page.route("**/*", refuse)
        one.page.on("websocket", lambda socket: one.asked.append(socket.url))
        one.page.on("console", lambda message: one.complaints.append(f"{message.type}: {message.text}"))
        one.page.on("pageerror", lambda error: one.complaints.append(str(error)))
        one.page.goto(report.as_uri())
        one.page.evaluate("window.drawn")
        return one

    yield open_at
    for one in visits:
        one.page.close()
        assert one.complaints == []
        assert [url for url in one.asked if not url.startswith("data:")] == []


def marks(chart: Locator, kind: str = "symbol") -> Locator:
    return chart.locator(f".mark-{kind}.role-mark path")


def choose_scene(page: Page, title: str) -> None:
    """Show a scene and wait until it is drawn."""
    page.locator("#scene").select_option(label=title)
    page.evaluate("window.drawn")


def pixels(canvas: Locator) -> list[tuple[int, ...]]:
    """(r, g, b) of every 13th pixel of a canvas."""
    read = canvas.evaluate(
        """node => {
            const copy = Object.assign(document.createElement("canvas"), { width: node.width, height: node.height });
            copy.getContext("2d").drawImage(node, 0, 0);
            const { data } = copy.getContext("2d").getImageData(0, 0, node.width, node.height), found = [];
            for (let at = 0; at < data.length; at += 4 * 13) found.push([...data.slice(at, at + 3)]);
            return found;
        }"""
    )
    return [tuple(one) for one in read]


def settled(page: Page) -> None:
    """Wait until both sides of the first viewer are drawn."""
    page.evaluate("first.done")


def test_the_report_is_small_enough_to_be_sent(report: Path) -> None:
    assert report.stat().st_size < LARGEST


def test_the_first_screen_has_the_answer_the_matrix_and_a_picture(visit: Callable[..., Visit]) -> None:
    page = visit(1400, 900).page
    verdict = page.locator(".verdict:visible p").first
    assert "of the shadow right in all 3 scenes" in verdict.inner_text() and "ms a frame" in verdict.inner_text()
    for part in (verdict, page.locator(".matrix:visible"), page.locator("#viewer .stage")):
        box = part.bounding_box()
        assert box is not None and box["y"] >= 0 and box["y"] + min(box["height"], 400) <= 900
    assert len(set(pixels(page.locator("#viewer canvas.a")))) > 50


def test_a_cell_of_the_matrix_shows_its_picture(visit: Callable[..., Visit]) -> None:
    page = visit().page
    cell = page.locator(".matrix:visible button", has_text="ray-traced").first
    cell.press("Enter")
    page.evaluate("window.drawn")
    assert cell.get_attribute("aria-pressed") == "true"
    assert page.locator("#viewer .tag.a").inner_text() == "ray-traced"


def test_a_scene_has_its_own_verdict_matrix_charts_and_table(visit: Callable[..., Visit]) -> None:
    page = visit().page
    before = [page.locator(".verdict:visible").inner_text(), page.locator("#table tbody").inner_text()]
    choose_scene(page, "colonnade, 512² view")
    after = [page.locator(".verdict:visible").inner_text(), page.locator("#table tbody").inner_text()]
    assert all(one != other for one, other in zip(before, after, strict=True))
    assert page.locator(".verdict:visible").count() == page.locator(".matrix:visible").count() == 1
    assert page.locator("#scene-shown").inner_text() == "colonnade, 512² view"


def test_every_chart_is_drawn(visit: Callable[..., Visit]) -> None:
    page = visit().page
    for title in page.locator("#scene option").all_inner_texts()[1:]:
        choose_scene(page, title)
        for kind, mark in (("front", "symbol"), ("sizes", "symbol"), ("passes", "rect")):
            chart = page.locator(f".chart.{kind}")
            assert marks(chart, mark).count() >= 3
            box = chart.locator("svg").bounding_box()
            assert box is not None and box["width"] > 300 and box["height"] > 100


def test_no_point_lies_outside_its_chart(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
    for chart in page.locator(".chart.front, .chart.sizes").all():
        frame = chart.locator("svg").bounding_box()
        assert frame is not None
        for mark in marks(chart).all():
            box = mark.bounding_box()
            assert box is not None
            assert frame["x"] <= box["x"] and box["x"] + box["width"] <= frame["x"] + frame["width"]
            assert frame["y"] <= box["y"] and box["y"] + box["height"] <= frame["y"] + frame["height"]


def test_a_point_tells_what_it_is_and_a_click_shows_its_picture(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
    point = marks(page.locator(".chart.front")).last
    said = told(page, point)
    for name in ("full spec", "1 − IoU", "edge px", "time", "× reference"):
        assert name in said
    assert "ms, IQR" in said
    spec = point.evaluate("node => node.__data__.datum.spec")
    point.click(force=True)
    settled(page)
    assert page.locator("#viewer .tag.a").inner_text().startswith(spec)


def test_buttons_zoom_and_take_back(visit: Callable[..., Visit]) -> None:
    page = visit().page
    figure = page.locator("figure:has(.chart.front)").first

    def time_axis() -> list[float]:
        domain: list[float] = figure.locator(".chart").evaluate("element => element.view.scale('x').domain()")
        return domain

    whole = time_axis()
    figure.get_by_role("button", name="Zoom in").press("Enter")
    page.wait_for_timeout(100)
    inner = time_axis()
    assert whole[0] < inner[0] < inner[1] < whole[1]
    figure.get_by_role("button", name="Reset").press("Enter")
    page.wait_for_timeout(100)
    assert time_axis() == pytest.approx(whole)


def test_shift_and_wheel_zoom_a_chart_and_the_wheel_alone_scrolls(visit: Callable[..., Visit]) -> None:
    page = visit().page
    chart = page.locator(".chart.front").first
    chart.scroll_into_view_if_needed()
    read = "element => element.view.scale('x').domain()"
    whole, before = chart.evaluate(read), page.evaluate("scrollY")
    chart.hover()
    page.mouse.wheel(0, 200)
    page.wait_for_function("before => scrollY > before", arg=before)
    assert chart.evaluate(read) == whole
    chart.hover()
    page.keyboard.down("Shift")
    page.mouse.wheel(0, -200)
    page.keyboard.up("Shift")
    page.wait_for_timeout(200)
    assert chart.evaluate(read) != whole


def test_eight_specs_at_most_are_shown_each_with_a_look_of_its_own(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
    legend = page.locator("#charts .legend")
    on, off = legend.locator("[aria-pressed=true]"), legend.locator("[aria-pressed=false]")

    def looks() -> dict[str, tuple[str, str]]:
        """Colour and shape of the points, by spec."""
        found = page.locator(".chart.sizes").evaluate(
            """element => element.view.data("source_0").filter(one => one.shown)
            .map(one => [one.spec, [one.color, one.shape]])"""
        )
        return {spec: (color, shape) for spec, (color, shape) in found}

    assert on.count() == 8 and off.count() > 0 and off.first.is_disabled()
    before = looks()
    for part in (0, 1):
        assert len({look[part] for look in before.values()}) == len(before) > 3
    turned_off, turned_on = on.nth(2).get_attribute("data-spec"), off.first.get_attribute("data-spec")
    on.nth(2).press("Enter")
    page.locator(f"#charts .legend [data-spec='{turned_on}']").press("Enter")
    page.wait_for_function(
        """spec => document.querySelector(".chart.sizes").view.data("source_0")
        .some(one => one.shown && one.spec === spec)""",
        arg=turned_on,
    )
    after = looks()
    assert turned_off not in after and turned_on in after and on.count() == 8
    assert all(after[spec] == look for spec, look in before.items() if spec in after), "a look stays with its spec"


# The wipe


def test_the_wipe_is_moved_by_slider_keys_and_drag(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator("#viewer")
    slider, stage = box.get_by_role("slider"), box.locator(".stage")
    right = box.locator(".layer.right")
    cut = "node => getComputedStyle(node).clipPath"
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert slider.input_value() == "60" and "60%" in right.evaluate(cut)
    stage.focus()
    page.keyboard.press("ArrowLeft")
    assert slider.input_value() == "58"
    frame = stage.bounding_box()
    assert frame is not None
    page.mouse.move(frame["x"] + 0.58 * frame["width"], frame["y"] + 50)
    page.mouse.down()
    page.mouse.move(frame["x"] + 0.25 * frame["width"], frame["y"] + 50)
    page.mouse.up()
    assert float(slider.input_value()) == pytest.approx(25, abs=1) and "25" in right.evaluate(cut)
    page.mouse.move(frame["x"] + 0.9 * frame["width"], frame["y"] + 50)
    assert float(slider.input_value()) == pytest.approx(25, abs=1), "the drag has ended"


def test_any_two_can_be_wiped_as_shaded_as_mask_or_as_difference(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "cube-on-plane, 512² view")
    box = page.locator("#viewer")
    left, right = box.locator("select.a"), box.locator("select.b")
    left.select_option(label=next(one for one in left.locator("option").all_inner_texts() if one.startswith("unshad")))
    right.select_option(
        label=next(one for one in right.locator("option").all_inner_texts() if one.startswith("ray-tr"))
    )
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
    # What is lit everywhere is lighter where the truth has a shadow, and false light there.
    shaded, difference = seen["shaded"], seen["difference"]
    shadow = [at for at, color in enumerate(seen["mask"][1]) if color == (0, 0, 0)]
    assert len(shadow) > 100
    assert sum(shaded[0][at][0] > shaded[1][at][0] for at in shadow) > 0.95 * len(shadow)
    assert sum(difference[0][at] == FALSE_LIGHT for at in shadow) > 0.9 * len(shadow)
    box.get_by_role("button", name="swap").press("Enter")
    settled(page)
    assert (pixels(b), pixels(a)) == difference
    right.select_option(label="truth (ray traced)")
    settled(page)
    assert FALSE_LIGHT not in pixels(b), "the truth has no error"


def test_zoom_and_pan_are_those_of_both_sides(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator("#viewer")
    stage = box.locator(".stage")

    def transforms() -> list[str]:
        return [box.locator(f"canvas.{side}").evaluate("node => getComputedStyle(node).transform") for side in "ab"]

    def moved(before: list[str]) -> list[str]:
        now = transforms()
        assert now[0] == now[1] and now != before
        return now

    now = transforms()
    frame = stage.bounding_box()
    assert frame is not None
    page.mouse.move(frame["x"] + frame["width"] / 3, frame["y"] + frame["height"] / 3)
    page.mouse.wheel(0, -300)
    page.wait_for_timeout(100)
    assert transforms() == now, "the wheel scrolls the page until the picture is chosen"
    page.evaluate("scrollTo(0, 0)")
    stage.focus()
    page.mouse.wheel(0, -300)
    page.wait_for_timeout(100)
    now = moved(now)
    stage.press("+")
    now = moved(now)
    stage.press("ArrowRight")
    now = moved(now)
    page.mouse.move(frame["x"] + 0.8 * frame["width"], frame["y"] + 100)
    page.mouse.down()
    page.mouse.move(frame["x"] + 0.7 * frame["width"], frame["y"] + 160)
    page.mouse.up()
    now = moved(now)
    assert box.locator(".readout").inner_text().startswith("pixel ")
    box.get_by_role("button", name="Zoom out").press("Enter")
    now = moved(now)
    stage.press("0")
    assert moved(now) == ["matrix(1, 0, 0, 1, 0, 0)"] * 2


def test_thumbnails_show_the_errors_and_lead_to_them(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "cube-on-plane, 512² view")
    sheet = page.locator("#errors .sheet")
    assert sheet.locator("button").count() == len(set(page.evaluate("first.cells.map((cell) => cell.spec)")))

    def stained(button: Locator) -> bool:
        return any(abs(red - blue) > 60 for red, _, blue in pixels(button.locator("canvas").first))

    right = sheet.locator("button", has_text="ray-traced")
    assert right.locator("canvas").count() == 1 and not stained(right)
    wrong = sheet.locator("button", has_text="IoU 0.99").first
    assert wrong.locator("canvas").count() == 2 and stained(wrong), "hundredths of the shadow, and they show"
    name = wrong.locator("span").inner_text()
    wrong.press("Enter")
    page.wait_for_function("() => first.scale > 1")
    assert page.locator("#viewer .tag.a").inner_text() == name
    assert page.locator("#viewer").get_by_role("radio", name="difference").is_checked()
    page.locator("#errors-size").select_option("2048")
    page.wait_for_function("() => document.querySelector('#errors .sheet').textContent.includes('at 2048')")


# The table


def test_the_table_is_sorted_by_any_column_both_ways(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
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


def test_the_table_is_filtered_and_has_the_columns_that_are_asked_for(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
    section = page.locator("#table")
    rows, heads = section.locator("tbody tr"), section.locator("thead th")
    every = rows.count()
    section.get_by_label("technique").select_option("ray-traced")
    assert rows.count() == 1 < every and rows.first.locator("th").inner_text() == "ray-traced"
    section.get_by_label("technique").select_option("")
    assert rows.count() == every
    section.locator("summary", has_text="columns").press("Enter")
    names = heads.all_inner_texts()
    assert "contact" not in names and "acne" in names
    section.get_by_label("contact", exact=True).check()
    section.get_by_label("acne", exact=True).uncheck()
    names = heads.all_inner_texts()
    assert "contact" in names and "acne" not in names
    assert rows.first.locator("td").count() == len(names) - 1


def test_the_first_column_stays_and_a_row_shows_its_picture(visit: Callable[..., Visit]) -> None:
    page = visit(390, 844).page
    table = page.locator("#table .wide")
    first = table.locator("tbody th").first
    before = first.bounding_box()
    table.evaluate("node => { node.scrollLeft = 200; }")
    after = first.bounding_box()
    assert before is not None and after is not None and before["x"] == after["x"]
    button = table.locator("tbody button").nth(2)
    name = button.inner_text()
    button.press("Enter")
    page.wait_for_function("name => document.querySelector('#viewer .tag.a').textContent.startsWith(name)", arg=name)


def test_the_theme_is_the_reader_s_and_is_turned_by_a_button(visit: Callable[..., Visit]) -> None:
    page = visit().page
    ground = "() => getComputedStyle(document.body).backgroundColor"
    ink = "() => getComputedStyle(document.querySelector('.chart.front .role-axis-label text')).fill"
    light, written = page.evaluate(ground), page.evaluate(ink)
    page.locator("#theme").press("Enter")
    dark = page.evaluate(ground)
    assert dark != light and page.evaluate(ink) != written
    page.locator("#theme").press("Enter")
    assert page.evaluate(ground) == light and page.evaluate(ink) == written
    page.emulate_media(color_scheme="dark")
    assert page.evaluate(ground) == dark
    page.emulate_media(media="print")
    assert (page.evaluate(ground), page.evaluate(ink)) == (light, written), "paper is white, whatever the screen is"


def test_passes_of_another_map_size_are_a_choice_away(visit: Callable[..., Visit]) -> None:
    page = visit().page
    choose_scene(page, "colonnade, 512² view")
    chart = page.locator(".chart.passes").first
    before = chart.inner_html()
    page.locator("#pass-size").select_option(label="2048")
    page.wait_for_function("([node, before]) => node.innerHTML !== before", arg=[chart.element_handle(), before])
    chart.locator(".mark-rect path").first.wait_for(state="attached")


def test_a_telephone_shows_all_of_it_without_scrolling_sideways(visit: Callable[..., Visit]) -> None:
    page = visit(390, 844).page
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    for chart in page.locator(".chart svg").all():
        box = chart.bounding_box()
        assert box is not None and box["x"] >= 0 and box["x"] + box["width"] <= 390


def test_every_control_is_reached_by_keys_and_named(visit: Callable[..., Visit]) -> None:
    page = visit().page
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


def test_the_report_prints_with_its_tables(visit: Callable[..., Visit], tmp_path: Path) -> None:
    page = visit().page
    page.pdf(path=tmp_path / "report.pdf", format="A4")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert page.evaluate("[...document.querySelectorAll('details')].every(node => node.open)")


def test_on_paper_no_text_is_smaller_than_nine_points_and_no_table_is_cut(visit: Callable[..., Visit]) -> None:
    page = visit(703, 1000).page  # A4 without its margins
    page.emulate_media(media="print")
    page.evaluate("document.querySelectorAll('details').forEach(node => node.open = true)")
    sizes = page.evaluate(
        """[...document.querySelectorAll("body *")]
        .filter(node => node.checkVisibility() && !node.closest("svg, script, style"))
        .filter(node => [...node.childNodes].some(one => one.nodeType === 3 && one.textContent.trim()))
        .map(node => 0.75 * parseFloat(getComputedStyle(node).fontSize))"""
    )
    assert len(sizes) > 200 and min(sizes) >= 9
    for table in page.locator("table.all, table.ranges, table.matrix").all():
        assert not table.is_visible() or table.evaluate("node => node.getBoundingClientRect().right") <= 703


def told(page: Page, mark: Locator) -> str:
    """The text of a mark's tooltip."""
    mark.scroll_into_view_if_needed()
    mark.hover(force=True)
    tooltip = page.locator("#vg-tooltip-element.visible")
    tooltip.wait_for(timeout=5000)
    return tooltip.inner_text()


def test_the_operating_ranges_can_be_read(visit: Callable[..., Visit]) -> None:
    page = visit().page
    table = page.locator(".ranges")
    assert table.locator("tbody tr").count() == len(AXES) and table.locator("td[style]").count() >= 12
    assert table.locator("td").first.evaluate("node => parseFloat(getComputedStyle(node).fontSize)") >= 12


def test_a_point_on_an_axis_tells_its_value_its_scores_and_its_failure(visit: Callable[..., Visit]) -> None:
    page = visit().page
    charts = page.locator(".chart.axis")
    assert charts.count() == len(AXES)
    chart = charts.nth(AXES.index("map-size"))  # whose smallest maps break
    broken = chart.locator('.mark-symbol.role-mark path[stroke]:not([stroke="none"])').first
    said = told(page, broken)
    assert "out of tolerance" in said and "1 − IoU" in said and "texels" in said


def test_metric_and_light_are_choices_of_all_axes(visit: Callable[..., Visit]) -> None:
    page = visit().page
    first, last = page.locator(".chart.axis").first, page.locator(".chart.axis").last

    def choose(name: str, value: str) -> list[str]:
        """Choose, wait until all is drawn, give the lines of the first axis."""
        page.locator(f"select[data-signal={name}]").select_option(value)
        page.evaluate(
            """Promise.all([...document.querySelectorAll(".chart.axis")].map((element) => element.view.runAsync()))
            .then(() => null)"""
        )
        paths: list[str] = marks(first, "line").evaluate_all("nodes => nodes.map((node) => node.getAttribute('d'))")
        return paths

    before = choose("metric", "1 − IoU")
    acne = choose("metric", "acne")
    assert len(acne) == len(before) and acne != before
    assert 0 < len(choose("light", "sun")) < len(before)
    choose("metric", "flips")
    assert not first.is_visible() and last.is_visible()
    assert choose("light", "all") == []
    assert sorted(choose("metric", "1 − IoU")) == sorted(before)
    for chart in (first, last):
        box = chart.locator("svg").bounding_box()
        assert box is not None and box["width"] > 300


def test_a_breaking_point_shows_its_picture(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator("#stability .viewer")
    view = box.locator("select.view")
    view.select_option("map-size 16 texels, sun")
    assert box.locator(".tag.a").inner_text() == "shadow-map" and box.locator(".tag.b").inner_text() == "truth"
    assert "leak" in box.locator(".caption.a").inner_text()
    assert re.search(r"shadowbench view \S+ --cell [0-9a-f]{24}$", box.locator(".caption.a").inner_text())
    box.get_by_role("radio", name="difference").check()
    page.wait_for_timeout(500)
    assert pixels(box.locator("canvas.a")) != pixels(box.locator("canvas.b"))


def test_a_split_report_opens_from_the_disk_and_loads_what_it_shows(
    browser: Browser, report: Path, tmp_path: Path
) -> None:
    page_file = tmp_path / "split #1 50%.html"
    command = [sys.executable, "-m", "shadowbench", "report", report.parent / "run", "-o", page_file, "--split", "-q"]
    subprocess.run(command, check=True)
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    complaints: list[str] = []
    loaded: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: loaded.append(request.url))
    page.goto(page_file.as_uri())
    page.evaluate("window.drawn")
    assert page.locator(".sheet canvas").count() > 0 and page.locator("#table tbody tr").count() > 0
    some = len(loaded)
    assert 1 < some < len(list((tmp_path / "split #1 50%.files").iterdir()))
    page.select_option("#scene", index=2)
    page.evaluate("window.drawn")
    assert len(loaded) > some
    assert {url.rpartition("/")[0] for url in loaded[1:]} == {(tmp_path / "split #1 50%.files").as_uri()}
    assert complaints == []
    page.close()


# Reports on rows with known answers

FILTERS = ("shadow-map", "shadow-map:filter=pcss", "shadow-map:filter=msm(blur=9)")
KNOWN = (
    *CELLS,
    *(replace(cell, scene="terrace") for cell in CELLS if cell.spec != "ray-traced"),
    *(Cell(f"shadow-map:filter=pcf(taps={taps})", 512, 0.1 + taps / 100, 3.0 + taps) for taps in range(2, 9)),
    *(Cell(spec, 512, 0.1, 9.0 + index, scene="post", rmse_pen=0.1 + index) for index, spec in enumerate(FILTERS)),
)


@pytest.fixture
def opened(
    browser: Browser, run_folder: Callable[..., Path], page_of: Callable[..., str], tmp_path: Path
) -> Iterator[Callable[..., Page]]:
    """Opens a report on KNOWN from the disk, with an address; errors fail the test."""
    page_of(run_folder(KNOWN, pictures=True))
    pages: list[Page] = []
    complaints: list[str] = []

    def open_at(address: str = "") -> Page:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto((tmp_path / "report.html").as_uri() + address)
        page.evaluate("window.drawn")
        pages.append(page)
        return page

    yield open_at
    for page in pages:
        page.close()
    assert complaints == []


def seen(page: Page) -> dict[str, object]:
    """What a reader sees of the choices."""
    settled(page)
    return {
        "scene": page.locator("#scene option:checked").inner_text(),
        "pictures of": page.locator("#scene-shown").inner_text(),
        "sides": [page.locator(f"#viewer .tag.{side}").inner_text() for side in "ab"],
        "mode": page.locator("#viewer .modes input:checked").input_value(),
        "lit": page.locator("#charts .legend [aria-pressed=true]").all_inner_texts(),
        "errors": page.locator("#errors .sheet b").all_inner_texts(),
    }


def test_the_legend_lights_what_the_charts_draw_and_names_what_has_no_points(opened: Callable[..., Page]) -> None:
    page = opened()
    legend, absent = page.locator("#charts .legend"), page.locator("#charts .legend + p + p")
    for title in page.locator("#scene option").all_inner_texts():
        choose_scene(page, title)
        lit = legend.locator("[aria-pressed=true]").evaluate_all("nodes => nodes.map((node) => node.dataset.spec)")
        drawn = page.evaluate(
            """[...document.querySelectorAll("#charts :is(.front, .sizes)")].flatMap((chart) =>
            chart.view.data("source_0").filter((one) => one.shown).map((one) => one.spec))"""
        )
        assert set(lit) == set(drawn) and 3 <= len(lit) <= 8
        assert not any(spec in absent.inner_text().split(": ")[1].rstrip(".").split(", ") for spec in lit)
        if title.startswith("post"):
            assert set(lit) == {*FILTERS}, "all that was asked for"
            assert "ray-traced" in absent.inner_text()
        if title == "all hard scenes":
            assert "ray-traced" not in lit and "ray-traced" in absent.inner_text()


def test_the_errors_are_worst_first_or_best_first(opened: Callable[..., Page]) -> None:
    page = opened()
    choose_scene(page, "stairs, 32² view")
    scores = [float(text.removeprefix("IoU ")) for text in page.locator("#errors .sheet b").all_inner_texts()]
    assert scores == sorted(scores) and scores[0] < 0.1 < scores[-1]
    page.locator("#errors-order").select_option("best first")
    page.evaluate("window.drawn")
    again = [float(text.removeprefix("IoU ")) for text in page.locator("#errors .sheet b").all_inner_texts()]
    assert again == scores[::-1]


def test_a_link_opens_the_same_choices_and_back_and_forward_go_through_them(opened: Callable[..., Page]) -> None:
    page = opened()
    first = seen(page)
    assert "#" not in page.url
    choose_scene(page, "stairs, 32² view")
    stairs = seen(page)
    page.locator("#viewer select.a").select_option(label="truth (ray traced)")
    page.locator("#viewer select.b").select_option(index=3)
    page.locator("#viewer").get_by_role("radio", name="difference").check()
    page.locator("#errors-order").select_option("best first")
    page.evaluate("window.drawn")
    page.locator("#charts .legend [data-spec=ray-traced]").click()
    chosen = seen(page)
    assert chosen["sides"][0] == "truth" and chosen["mode"] == "difference" and "ray-traced" not in chosen["lit"]  # type: ignore[operator, index]
    page.locator("nav a", has_text="Charts").click()
    assert "scene=" in page.url, "a link within the page leaves the choices in the address"
    address = "#" + page.url.partition("#")[2]
    assert seen(opened(address)) == chosen
    for steps, expected in ((-5, stairs), (-1, first), (6, chosen)):
        page.evaluate("steps => new Promise((done) => { onhashchange = done; history.go(steps); })", steps)
        page.evaluate("window.drawn")
        assert seen(page) == expected
    choose_scene(page, "all hard scenes")
    page.locator(".matrix:visible tbody").nth(1).locator("button").last.click()
    page.evaluate("window.drawn")
    overall = seen(page)
    assert overall["scene"] == "all hard scenes" and overall["pictures of"] == "terrace, 32² view"
    assert seen(opened("#" + page.url.partition("#")[2])) == overall
    unknown = opened("#scene=nowhere&left=nothing&mode=loud")
    assert seen(unknown) == first


def test_a_picture_of_one_phase_says_so_beside_the_median(
    browser: Browser, run_folder: Callable[..., Path], page_of: Callable[..., str], tmp_path: Path
) -> None:
    errors = (0.06, 0.04, 0.02)
    cells = [Cell("shadow-map", 512, error, 5.0 if not at else None, phase=at) for at, error in enumerate(errors)]
    page_of(run_folder(cells, pictures=True))
    page = browser.new_page()
    page.goto((tmp_path / "report.html").as_uri())
    page.evaluate("window.drawn")
    cell = page.locator(".matrix button").first.inner_text()
    caption, thumbnail = page.locator(".caption.a").inner_text(), page.locator("#errors .sheet button").inner_text()
    assert "IoU 0.96 (0.94–0.98)" in cell
    for text in (caption, thumbnail):
        assert "median IoU 0.96 (0.94–0.98)" in text and "picture: phase 0, IoU 0.94000" in text
    assert "3" in page.locator("#provenance dt", has_text="phases").locator("+ dd").inner_text()
    page.close()
