"""Takes docs/pictures/report.png, the first screen of a report on the demo, and site.png; needs Chromium.

python tools/readme_picture.py [DIR]: DIR is a run folder, by default results/demo, that of `make demo`. The site is the
one that `make site` built.
"""

import argparse
import io
import shutil
import tempfile
from pathlib import Path

import ages
import numpy as np
from pages import png
from PIL import Image
from playwright.sync_api import sync_playwright

from shadowbench.reports.report import write_report
from shadowbench.results.configurations import sections
from shadowbench.results.folder import read_folders
from shadowbench.results.law import law_on_record

ROOT = Path(__file__).resolve().parent.parent
COMMAND = f"make demo site; python tools/{Path(__file__).name}"
PICTURES = ROOT / "docs" / "pictures"
SITE = ROOT / "build" / "site" / "index.html"
WIDTH, HEIGHT = 1200, 800  # pixels of the window
LARGEST = 300_000  # bytes


def main() -> None:
    """Make the report in a temporary folder, open it and the site, and keep what the window shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="?", default=ROOT / "results" / "demo")
    runs, sweeps = read_folders([parser.parse_args().folder])
    with tempfile.TemporaryDirectory() as scratch:
        report = Path(scratch) / "report.html"
        write_report(runs, sections(runs, law_on_record()), sweeps, report, "html")
        for page, name in ((report, "report.png"), (SITE, "site.png")):
            shown = Image.open(io.BytesIO(_first_screen(page))).convert("RGB")
            (PICTURES / name).write_bytes(png([np.asarray(shown)], LARGEST))
            print(PICTURES / name)
    ages.renew(ROOT / "docs" / "index.md", COMMAND, state=["times"])
    ages.renew(ROOT / "docs" / "how-to" / "site.md", COMMAND)


def _first_screen(file: Path) -> bytes:
    """A screenshot, as PNG."""
    with sync_playwright() as playwright:
        chromium = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
        page.goto(file.as_uri())
        page.evaluate("window.drawn")
        taken = page.screenshot()
        browser.close()
    return taken


if __name__ == "__main__":
    main()
