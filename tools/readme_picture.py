"""Takes docs/pictures/report.png, the first screen of a report on the demo; needs Chromium.

python tools/readme_picture.py [DIR]: DIR is a run folder, by default results/demo, that of `make demo`.
"""

import argparse
import io
import shutil
import tempfile
from pathlib import Path

import numpy as np
from pages import png
from PIL import Image
from playwright.sync_api import sync_playwright

from shadowbench.reports.report import write_report
from shadowbench.results.configurations import sections
from shadowbench.results.folder import read_folders

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "pictures" / "report.png"
WIDTH, HEIGHT = 1200, 800  # pixels of the window
LARGEST = 300_000  # bytes


def main() -> None:
    """Make the report in a temporary folder, open it, and keep what the window shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="?", default=ROOT / "results" / "demo")
    runs, sweeps = read_folders([parser.parse_args().folder])
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch) / "report.html"
        write_report(runs, sections(runs), sweeps, report, "html")
        shown = Image.open(io.BytesIO(_first_screen(report))).convert("RGB")
    PICTURE.write_bytes(png([np.asarray(shown)], LARGEST))
    print(PICTURE)


def _first_screen(report: Path) -> bytes:
    """A screenshot, as PNG."""
    with sync_playwright() as playwright:
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
        page.goto(report.as_uri())
        page.evaluate("window.drawn")
        taken = page.screenshot()
        browser.close()
    return taken


if __name__ == "__main__":
    main()
