"""The report of a run and a sweep in a real browser: it draws, answers, prints, and asks nothing of a network."""

import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Locator, Page, Request, Route, sync_playwright

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

SCENES = 3
AXES = ("elevation", "map-size", "camera-step")
LARGEST = 15e6  # bytes


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the demo study and of a small sweep, made by the commands that make them."""
    folder = tmp_path_factory.mktemp("demo")
    shadowbench = [sys.executable, "-m", "shadowbench"]
    # Each cell is timed thrice in place of nine times: nothing here depends on how well.
    subprocess.run([*shadowbench, "run", "-s", "demo", "--rounds", "3", "-o", folder / "run", "--quiet"], check=True)
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
    """A page that is open, what it complained of, and what it asked for beside itself."""

    page: Page
    complaints: list[str] = field(default_factory=list)
    asked: list[str] = field(default_factory=list)


@pytest.fixture
def visit(browser: Browser, report: Path) -> Iterator[Callable[..., Visit]]:
    """Opens the report and waits until its charts are drawn; after the test nothing may have gone wrong."""
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


def is_seen(image: Locator) -> bool:
    return bool(image.evaluate("node => node.complete && node.naturalWidth > 0"))


def test_it_is_small_enough_to_be_sent(report: Path) -> None:
    assert report.stat().st_size < LARGEST


def test_every_chart_is_drawn(visit: Callable[..., Visit]) -> None:
    page = visit().page
    for kind, mark in (("front", "symbol"), ("sizes", "symbol"), ("passes", "rect")):
        charts = page.locator(f".chart.{kind}")
        assert charts.count() == SCENES
        for chart in charts.all():
            assert marks(chart, mark).count() >= 12
            box = chart.locator("svg").bounding_box()
            assert box is not None and box["width"] > 300 and box["height"] > 200


def test_no_point_lies_outside_its_chart(visit: Callable[..., Visit]) -> None:
    page = visit().page
    for chart in page.locator(".chart.front, .chart.sizes").all():
        frame = chart.locator("svg").bounding_box()
        assert frame is not None
        for mark in marks(chart).all():
            box = mark.bounding_box()
            assert box is not None
            assert frame["x"] <= box["x"] and box["x"] + box["width"] <= frame["x"] + frame["width"]
            assert frame["y"] <= box["y"] and box["y"] + box["height"] <= frame["y"] + frame["height"]


def test_a_point_tells_what_it_is(visit: Callable[..., Visit]) -> None:
    page = visit().page
    point = marks(page.locator(".chart.front").first).last
    point.scroll_into_view_if_needed()
    point.hover(force=True)
    tooltip = page.locator("#vg-tooltip-element.visible")
    tooltip.wait_for(timeout=5000)
    said = tooltip.inner_text()
    for name in ("full spec", "1 − IoU", "edge px", "time", "× reference"):
        assert name in said
    assert "ms, IQR" in said


def test_buttons_zoom_and_take_back(visit: Callable[..., Visit]) -> None:
    page = visit().page
    figure = page.locator("figure:has(.chart.front)").first

    def time_axis() -> list[float]:
        domain: list[float] = figure.locator(".chart").evaluate("place => place.view.scale('x').domain()")
        return domain

    whole = time_axis()
    figure.get_by_role("button", name="Zoom in").press("Enter")
    page.wait_for_timeout(100)
    inner = time_axis()
    assert whole[0] < inner[0] < inner[1] < whole[1]
    figure.get_by_role("button", name="Reset").press("Enter")
    page.wait_for_timeout(100)
    assert time_axis() == pytest.approx(whole)


def test_shift_and_wheel_zoom_and_the_wheel_alone_scrolls(visit: Callable[..., Visit]) -> None:
    page = visit().page
    chart = page.locator(".chart.front").first
    chart.scroll_into_view_if_needed()
    read = "place => place.view.scale('x').domain()"
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


def test_the_legend_shows_one_spec_alone(visit: Callable[..., Visit]) -> None:
    page = visit().page
    points = marks(page.locator(".chart.front").first)
    count = "nodes => nodes.filter(node => Number(getComputedStyle(node).opacity) < 0.2).length"
    assert points.evaluate_all(count) == 0
    button = page.locator(".legend button").first
    button.press("Enter")
    page.wait_for_timeout(100)
    assert 0 < points.evaluate_all(count) < points.count() and button.get_attribute("aria-pressed") == "true"
    button.press("Enter")
    page.mouse.move(0, 0)
    page.wait_for_timeout(100)
    assert points.evaluate_all(count) == 0


def test_the_slider_wipes_between_technique_and_truth(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator(".gallery").first
    slider = box.get_by_role("slider")
    cut = "node => getComputedStyle(node).clipPath"
    under = box.locator(".wipe .under")
    before = under.evaluate(cut)
    slider.focus()
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert slider.input_value() == "60"
    assert "50%" in before and "60%" in under.evaluate(cut)
    # What is on the screen moves too: at the ends it is all truth, and all technique.
    shots = []
    for end in ("Home", "End"):
        page.keyboard.press(end)
        shots.append(box.locator(".wipe").screenshot())
    assert shots[0] != shots[1]


def test_pictures_follow_what_is_chosen(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator(".gallery").first
    images = [box.locator(f".tiles .of-{kind}") for kind in ("picture", "mask", "truth", "difference")]
    assert all(is_seen(image) for image in images)
    box.locator("select.spec").select_option("unshadowed")
    assert "IoU 0.00000" in box.locator(".scores").inner_text()
    assert "unshadowed" in (images[1].get_attribute("alt") or "")
    thumbnail = box.locator(".sheet button", has_text="IoU 1.00000").first
    thumbnail.press("Enter")
    assert box.locator("select.spec").input_value() == "ray-traced"
    assert box.locator(".sheet button[aria-pressed=true]").count() == 1
    assert all(is_seen(image) for image in images)


def test_passes_of_another_map_size_are_a_choice_away(visit: Callable[..., Visit]) -> None:
    page = visit().page
    chart = page.locator(".chart.passes").first
    before = chart.inner_html()
    page.locator("select.pass-size").first.select_option("4096")
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
        .filter(node => !node.hidden && !node.closest("[hidden]"))
        .filter(node => node.tabIndex < 0
            || !(node.textContent.trim() || node.ariaLabel || node.labels?.[0]?.textContent.trim()))
        .map(node => node.outerHTML.slice(0, 200))"""
    )
    assert nameless == []
    assert page.evaluate("[...document.images].filter(image => !image.hasAttribute('alt')).length") == 0
    page.keyboard.press("Tab")
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") == "solid"


def test_it_prints_with_its_tables(visit: Callable[..., Visit], tmp_path: Path) -> None:
    page = visit().page
    page.pdf(path=tmp_path / "report.pdf", format="A4")
    assert (tmp_path / "report.pdf").read_bytes().startswith(b"%PDF")
    assert page.evaluate("[...document.querySelectorAll('details')].every(node => node.open)")


def told(page: Page, mark: Locator) -> str:
    """What the tooltip of a mark says."""
    mark.scroll_into_view_if_needed()
    mark.hover(force=True)
    tooltip = page.locator("#vg-tooltip-element.visible")
    tooltip.wait_for(timeout=5000)
    return tooltip.inner_text()


def test_the_operating_ranges_are_drawn_and_tell_all(visit: Callable[..., Visit]) -> None:
    page = visit().page
    heat = page.locator(".chart.heat")
    ranges = page.locator(".ranges td[style]")
    assert marks(heat, "rect").count() == ranges.count() >= 12
    box = heat.locator("svg").bounding_box()
    assert box is not None and box["width"] > 900
    said = told(page, marks(heat, "rect").first)
    for name in ("spec", "light", "axis", "holds", "range", "must hold"):
        assert name in said


def test_a_telephone_has_the_heat_map_without_texts_and_tells_them(visit: Callable[..., Visit]) -> None:
    page = visit(390, 844).page
    heat = page.locator(".chart.heat")
    assert heat.locator(".mark-text.role-mark text").count() == 0
    assert "range" in told(page, marks(heat, "rect").first)


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
            """Promise.all([...document.querySelectorAll(".chart.axis")].map((place) => place.view.runAsync()))
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


def test_a_break_shows_its_picture_and_whoever_breaks_there(visit: Callable[..., Visit]) -> None:
    page = visit().page
    box = page.locator("#stability .gallery")
    images = [box.locator(f".tiles .of-{kind}") for kind in ("picture", "mask", "truth", "difference")]
    assert all(is_seen(image) for image in images)
    # A spec that holds at the place that is shown takes its own first break.
    for spec in ("cube-map", "shadow-map"):
        box.locator("select.spec").select_option(spec)
        assert spec in (images[1].get_attribute("alt") or "")
        assert all(is_seen(image) for image in images)
    box.locator("select.place").select_option("map-size 16 texels, sun")
    assert "leak" in box.locator(".scores").inner_text()
    assert box.locator("select.size").is_hidden()
