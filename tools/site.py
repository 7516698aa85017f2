"""Builds the site of results from results/published/ into build/site/; nothing is measured.

python tools/site.py [DIR...] [-o FOLDER]: DIR are run folders, by default those in results/published/.
"""

import argparse
from pathlib import Path

from shadowbench.errors import counted
from shadowbench.reports.site import write_site

ROOT = Path(__file__).resolve().parent.parent
ORDER = ("techniques", "plants", "engines")


def main() -> None:
    """Write the site, and print how many rows it has."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="DIR", type=Path, nargs="*")
    parser.add_argument("-o", dest="target", metavar="FOLDER", type=Path, default=ROOT / "build" / "site")
    asked = parser.parse_args()
    published = [folder for name in ORDER if (folder := ROOT / "results" / "published" / name).exists()]
    asked.target.mkdir(parents=True, exist_ok=True)
    rows = write_site(asked.folders or published, asked.target)
    print(f"{asked.target}: {counted(rows, 'row')}")


if __name__ == "__main__":
    main()
