"""Draws docs/pictures/scenes.png and held-out.png: the built-in and the held-out scenes, ray traced.

Each is drawn under its first light, soft if that has a size.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pages import grid, labelled, png, renew

import shadowbench as sb
from shadowbench.scenes.library import builtin_names

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
SIZE, COLUMNS, LARGEST = 180, 6, 250_000  # pixels along a side of a tile, tiles in a row, bytes


def main() -> None:
    """Write the pictures."""
    draw("scenes.png", DOCS / "reference" / "scenes.md", {name: name for name in builtin_names()})
    held_out = {path.stem: path for path in sorted((ROOT / "benchmarks" / "held-out").glob("*.toml"))}
    draw("held-out.png", DOCS / "how-to" / "held-out.md", held_out)


def draw(name: str, page: Path, scenes: Mapping[str, str | Path]) -> None:
    """Write the picture of scenes by label, and renew its record on its page."""
    spec = "ray-traced:samples=64"
    drawn = {label: sb.render(scene, spec, view_size=SIZE).picture for label, scene in scenes.items()}
    renew(page, f"python tools/{Path(__file__).name}")
    tiles = [labelled(np.asarray(one), label) for label, one in drawn.items()]
    (DOCS / "pictures" / name).write_bytes(png([grid(tiles, COLUMNS)], LARGEST))
    print(name)


if __name__ == "__main__":
    main()
