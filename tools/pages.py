"""Helpers of the tools that generate pages of docs/: small PNGs, labels, and detection of stale pages."""

import difflib
import io
import re
import sys
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

LABEL = 22  # pixels, the height of a label
MEASURED = "<!-- measured by "
"""What a comment above a measured table or picture begins with."""
NUMBERS = re.compile(r"-?\d+\.\d+|…")


def measured(command: str) -> str:
    """The comment for a figure made now by a command."""
    return f"{MEASURED}'{command}', {datetime.now(UTC):%Y-%m-%d} -->"


def renew(page: Path, command: str) -> None:
    """Replace the date of a command's figure in a page. Raises SystemExit unless there is one."""
    text = page.read_text(encoding="utf-8")
    made, count = re.subn(rf"(?m)^{re.escape(MEASURED)}'{re.escape(command)}', .*$", measured(command), text)
    if count != 1:
        raise SystemExit(f"{page}: found {count} figures of {command!r}; allowed: 1")
    page.write_text(made, encoding="utf-8")


def labelled(tile: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
    """A (H, W, 3) picture with a line of text drawn over its top LABEL rows."""
    image = Image.fromarray(tile)
    draw = ImageDraw.Draw(image)
    draw.rectangle((0, 0, image.width, LABEL), fill=(255, 255, 255))
    draw.text((6, 4), text, fill=(0, 0, 0), font=ImageFont.load_default(13))
    return np.asarray(image)


def grid(tiles: Sequence[NDArray[np.uint8]], columns: int) -> NDArray[np.uint8]:
    """One (H, W, 3) picture of equal tiles in rows of `columns`, the last filled with white."""
    columns = min(columns, len(tiles))
    filled = [*tiles, *[np.full_like(tiles[0], 255)] * (-len(tiles) % columns)]
    return np.vstack([np.hstack(filled[at : at + columns]) for at in range(0, len(filled), columns)])


def png(frames: Sequence[NDArray[np.uint8]], largest: int) -> bytes:
    """PNG of (H, W, 3) frames, animated if there are several; with 256 or 16 colours if it would be too large.

    largest: in bytes. Raises SystemExit if 16 colours are still too large.
    """
    film = Image.fromarray(np.vstack(frames))
    for image in (film, film.quantize(256), film.quantize(16)):
        height = film.height // len(frames)  # all frames share a palette
        first, *rest = (image.crop((0, top, film.width, top + height)) for top in range(0, film.height, height))
        stream = io.BytesIO()
        moves = {"save_all": True, "append_images": rest, "duration": 400, "loop": 0} if rest else {}
        first.save(stream, format="PNG", optimize=True, **moves)
        if stream.tell() < largest:
            return stream.getvalue()
    raise SystemExit(f"a picture takes {stream.tell()} bytes; allowed are {largest}")


def without_numbers(page: str) -> str:
    """A page without the numbers in its lines of measurements, and without records of them, for `compare`."""
    lines = (line for line in page.splitlines() if not line.startswith(MEASURED))
    return "\n".join(NUMBERS.sub("…", line) if line.startswith("Measured") else line for line in lines)


def compare(file: Path, generated: str, tool: str) -> int:
    """Compare a committed page with the generated one: 0, or if stale 1, with the difference printed."""
    committed = file.read_text(encoding="utf-8") if file.exists() else ""
    old, new = without_numbers(committed).splitlines(), without_numbers(generated).splitlines()
    lines = list(difflib.unified_diff(old, new, file.name, "generated", lineterm="", n=0))
    if lines:
        print("\n".join(lines))
        print(f"stale: run python tools/{tool}", file=sys.stderr)
    return int(bool(lines))
