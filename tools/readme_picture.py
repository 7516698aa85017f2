"""Takes docs/pictures/report.png, the first screen of a report on the demo; needs Chromium.

python tools/readme_picture.py [DIR]: DIR is a run folder, by default results/demo, that of `make demo`.
"""

import argparse
import io
import shutil
import tempfile
from pathlib import Path

import numpy as np
from pages import png, renew
from PIL import Image
from playwright.sync_api import sync_playwright

from shadowbench.reports.report import write_report
from shadowbench.results.frame import read_folders
from shadowbench.results.law import law_on_record
from shadowbench.results.summary import summaries

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "pictures" / "report.png"
WIDTH, HEIGHT = 1200, 800  # pixels of the window
LARGEST = 300_000  # bytes


def main() -> None:
    """Make the report in a temporary folder, open it, and keep what the window shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="?", default=ROOT / "results" / "demo")
    runs, sweeps = read_folders([parser.parse_args().folder])
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as playwright:
        report, law = Path(scratch) / "report.html", law_on_record()
        write_report([(run, summaries(run, law)) for run in runs], sweeps, report, "html")
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT}, color_scheme="light")
        page.goto(report.as_uri())
        page.evaluate("window.drawn")
        shown = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
        browser.close()
    PICTURE.write_bytes(png([np.asarray(shown)], LARGEST))
    print(PICTURE)
    renew(ROOT / "docs" / "index.md", f"make demo; python tools/{Path(__file__).name}")


if __name__ == "__main__":
    main()
