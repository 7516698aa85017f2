"""Draws docs/pictures/scenes.png and held-out.png: the built-in and the held-out scenes, ray traced.

Each is drawn under its first light, soft if that has a size.
"""

from pathlib import Path

import numpy as np
from pages import grid, labelled, png

import shadowbench as sb

ROOT = Path(__file__).resolve().parent.parent
SIZE, COLUMNS, LARGEST = 180, 6, 250_000  # pixels along a side of a tile, tiles in a row, bytes


def main() -> None:
    """Write the pictures."""
    for file, sources in (
        ("scenes.png", {name: name for name in sb.catalogue("scenes")["name"]}),
        ("held-out.png", {path.stem: path for path in sorted((ROOT / "benchmarks" / "held-out").glob("*.toml"))}),
    ):
        drawn = {name: sb.render(one, "ray-traced:samples=64", view_size=SIZE).picture for name, one in sources.items()}
        tiles = [labelled(np.asarray(one), name) for name, one in drawn.items()]
        (ROOT / "docs" / "pictures" / file).write_bytes(png([grid(tiles, COLUMNS)], LARGEST))
        print(file)


if __name__ == "__main__":
    main()
