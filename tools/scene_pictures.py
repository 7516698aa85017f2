"""Draws docs/pictures/scenes.png: every built-in scene, ray traced, under its first light, soft if that has a size."""

from pathlib import Path

import ages
import numpy as np
from pages import grid, labelled, png

import shadowbench as sb

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGE, FILE = DOCS / "reference" / "scenes.md", DOCS / "pictures" / "scenes.png"
SIZE, COLUMNS, LARGEST = 180, 6, 250_000  # pixels along a side of a tile, tiles in a row, bytes


def main() -> None:
    """Write the picture."""
    names = sb.catalogue("scenes")["name"]
    drawn = {name: sb.render(name, "ray-traced:samples=64", view_size=SIZE).picture for name in names}
    ages.renew(PAGE, f"python tools/{Path(__file__).name}", ["ray-traced"])
    FILE.write_bytes(png([grid([labelled(np.asarray(one), name) for name, one in drawn.items()], COLUMNS)], LARGEST))
    print(FILE)


if __name__ == "__main__":
    main()
