"""Visits of pages on the disk in a headless Chromium."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright


@contextmanager
def chromium() -> Iterator[Browser]:
    """Debian's Chromium; `make test-slow` installs it."""
    path = shutil.which("chromium")
    assert path, "no chromium on the path; `tools/setup.sh chromium` installs it"
    with sync_playwright() as playwright:
        # A container's root has no sandbox to give; the page is ours.
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


@contextmanager
def visiting(browser: Browser, file: Path) -> Iterator[Page]:
    """Opens a page from the disk and waits until it is drawn; messages, errors and other requests fail the test."""
    page = browser.new_page(viewport={"width": 1400, "height": 900})
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(f"{message.type}: {message.text}"))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("websocket", lambda socket: complaints.append(socket.url))
    page.on(
        "request",
        lambda request: None if request.url.startswith(("file:", "data:")) else complaints.append(request.url),
    )
    page.goto(file.as_uri())
    page.evaluate("window.drawn")
    yield page
    page.close()
    assert complaints == []
