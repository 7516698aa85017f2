"""The page's copy of Vega. `python -m tests.reports.test_vega` makes it anew from the pinned vl-convert."""

import gzip
from pathlib import Path

import vl_convert

from shadowbench.reports import report

FILE = Path(report.__file__).parent / "page" / "vega.js.gz"
LICENCES = (
    "/* Vega, Vega-Lite: BSD 3-Clause, © University of Washington Interactive Data Lab; D3: ISC, © Mike Bostock */\n"
)


def made() -> str:
    return LICENCES + vl_convert.javascript_bundle(snippet="window.vegaEmbed = vegaEmbed;")


def test_the_page_has_the_vega_that_draws_its_charts_as_files() -> None:
    assert gzip.decompress(FILE.read_bytes()).decode() == made()


if __name__ == "__main__":
    FILE.write_bytes(gzip.compress(made().encode(), mtime=0))
