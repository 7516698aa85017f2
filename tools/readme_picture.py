"""Takes docs/pictures/report.png, the first screen of a report on the demo; needs Chromium.

python tools/readme_picture.py [DIR]: DIR is a run folder, by default results/demo, that of `make demo`.
"""

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from pages import png, renew
from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / "docs" / "pictures" / "report.png"
WIDTH, HEIGHT = 1200, 800  # pixels of the window
LARGEST = 300_000  # bytes


def main() -> None:
    """Make the report in a temporary folder, open it, and keep what the window shows."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, nargs="?", default=ROOT / "results" / "demo")
    command = [sys.executable, "-m", "shadowbench", "report", parser.parse_args().folder]
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as playwright:
        report = Path(scratch) / "report.html"
        subprocess.run([*command, "-o", report, "--quiet"], check=True)
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
