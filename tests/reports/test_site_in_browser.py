"""The site of results in a real browser: wide and narrow, light and dark, by keyboard, nothing from elsewhere."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser

from shadowbench.reports.site import write_site
from tests.reports.browsing import visiting
from tests.reports.conftest import CELLS
from tests.reports.test_site import write_folders

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]

PAGES = ("index", "techniques", "engines", "yours", "scenes/stairs", "scenes/post")
PAPER = {"light": "rgb(255, 255, 255)", "dark": "rgb(22, 24, 28)"}


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("site")
    write_site(write_folders(tmp_path_factory.mktemp("folders")), target)
    return target


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", PAPER)
@pytest.mark.parametrize("width", [1400, 400])
def test_a_page_fits_its_window_in_the_colours_of_its_reader(
    browser: Browser, site: Path, name: str, scheme: str, width: int
) -> None:
    with visiting(browser, site / f"{name}.html", width=width, color_scheme=scheme) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == PAPER[scheme]
        broken = "[...document.images].filter((one) => one.loading !== 'lazy' && !one.naturalWidth).length"
        assert page.evaluate(broken) == 0
        # A browser that can scroll a table by the keyboard focuses it.
        assert page.locator(".wide:not([tabindex])").count() == 0


def test_a_value_of_the_first_page_leads_by_keyboard_to_its_row_and_from_there_to_its_picture(
    browser: Browser, site: Path
) -> None:
    with visiting(browser, site / "index.html") as page:
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.className") == "skip"
        cell = page.locator(f'.errors a[href$="{CELLS[2].key}"]')
        cell.focus()
        page.keyboard.press("Enter")
        page.wait_for_url(f"**/scenes/stairs.html#{CELLS[2].key}")
        row = page.locator("tr:target")
        assert row.get_attribute("id") == CELLS[2].key
        box = row.bounding_box()
        assert box is not None and 0 <= box["y"] < 900
        row.locator("summary").focus()
        page.keyboard.press("Enter")
        assert "shadowbench repro" in row.locator("details").inner_text()
        page.locator(".tiles a", has_text="shadow-map at 1024").first.press("Enter")
        page.wait_for_url("**/techniques.html#*")
        page.evaluate("window.drawn")
        assert page.locator("#viewer .tag.a").inner_text() == "shadow-map at 1024"
        assert page.locator("#viewer .tag.b").inner_text() == "truth"
        page.locator("#viewer .caption.a a").press("Enter")
        page.wait_for_url(f"**/scenes/stairs.html#{CELLS[2].key}")


def test_pictures_are_loaded_when_they_come_into_view(browser: Browser, site: Path) -> None:
    with visiting(browser, site / "scenes" / "stairs.html") as page:
        picture = page.locator(".tiles img").last
        picture.scroll_into_view_if_needed()
        page.wait_for_function("image => image.complete", arg=picture.element_handle())
        assert picture.evaluate("image => image.naturalWidth") == 256
