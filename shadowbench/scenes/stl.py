"""Checks of STL files before trimesh reads them, as trimesh silently truncates damaged ones."""

import re

from shadowbench.errors import InputError
from shadowbench.scenes.lines import LONGEST_LINE

MOST_SOLIDS = 1000
"""Largest number of solids in a text STL: trimesh takes quadratic time to give them unique names."""


def checked_stl(data: bytes, where: str) -> bytes:
    """The bytes of an STL; those of a text STL converted to UTF-8, the only encoding that trimesh reads.

    Raises InputError for a binary file whose length does not match its triangle count, and for a text file with an
    unfinished solid.
    """
    count = int.from_bytes(data[80:84], "little")
    if len(data) == 84 + 50 * count:
        return data
    if re.search(rb"[^\r\n]{%d}" % (LONGEST_LINE + 1), data):
        raise InputError(f"{where}: a line of more than {LONGEST_LINE} bytes; allowed are shorter ones")
    text = data.lower()
    if not text.lstrip().startswith(b"solid"):
        raise InputError(f"{where}: cut short: {count} triangles announced, room for {max(len(data) - 84, 0) // 50}")
    if (solids := text.count(b"endsolid")) > MOST_SOLIDS:
        raise InputError(f"{where}: {solids} solids; allowed are at most {MOST_SOLIDS}, or a binary file")
    if text.rfind(b"vertex") > text.rfind(b"endsolid"):
        raise InputError(f"{where}: cut short: a solid without its endsolid")
    return data.decode("utf-8", errors="replace").encode()
