"""Helpers of the tools that generate pages of docs/: tables, small PNGs, labels, and detection of stale pages."""

import argparse
import difflib
import io
import re
import sys
from collections.abc import Collection, Iterable, Mapping, Sequence
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


def completed(page: Path, mark: str, lines: Sequence[str]) -> str:
    """What a page has above its first line that begins with `mark`, written by hand, and generated lines below."""
    above = page.read_text(encoding="utf-8").partition(f"\n{mark}")[0]
    return "\n".join([above, *lines]).rstrip("\n") + "\n"


def filled(tool: str, values: Mapping[str, str]) -> str:
    """The template beside a tool, with values in place of their names between @."""
    text = Path(tool).with_suffix(".md").read_text(encoding="utf-8")
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    return text


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], texts: Collection[str] = ()) -> list[str]:
    """Lines of a Markdown table, numbers to the right; texts: headings of other columns than the first."""
    rule = "".join("|---" if name in texts or not at else "|---:" for at, name in enumerate(headings))
    head, *lines = (f"| {' | '.join(map(str, row))} |" for row in (headings, *rows))
    return [head, f"{rule}|", *lines]


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


def checks(description: str | None) -> bool:
    """Whether the command line has --check."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--check", action="store_true", help="exit 1 if a committed text is stale; write nothing")
    return bool(parser.parse_args().check)


def write(texts: Mapping[Path, str], check: bool) -> int:
    """Write pages, or only compare them with the committed ones: 0, or if one is stale 1."""
    if check:
        return max([compare(file, text) for file, text in texts.items()])
    for file, text in texts.items():
        file.write_text(text, encoding="utf-8")
        print(file)
    return 0


def compare(file: Path, generated: str) -> int:
    """Compare a committed page with the generated one: 0, or if stale 1, with the difference printed."""
    committed = file.read_text(encoding="utf-8") if file.exists() else ""
    old, new = without_numbers(committed).splitlines(), without_numbers(generated).splitlines()
    lines = list(difflib.unified_diff(old, new, file.name, "generated", lineterm="", n=0))
    if lines:
        print("\n".join(lines))
        print(f"stale: run python tools/{Path(sys.argv[0]).name}", file=sys.stderr)
    return int(bool(lines))
