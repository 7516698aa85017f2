"""What an STL file declares about itself, checked before trimesh reads it, which cuts short in silence."""

import re

from shadowbench.errors import InputError
from shadowbench.scenes.lines import LONGEST_LINE

MOST_SOLIDS = 1000
"""In a text STL: trimesh looks for a name that is free among all before it."""


def checked_stl(data: bytes, where: str) -> bytes:
    """The bytes of an STL, a text one in UTF-8: names may be in any code, and trimesh reads only this one.

    Raises InputError for a binary file that is not as long as its count says, and for a text one that does not end what
    it begins.
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
