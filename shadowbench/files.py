"""Files that are either the old one or the whole new one, also when the program is killed while it writes."""

import errno
import io
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""What an OSError says of a disk, a quota or a limit on files that has no room left."""


@contextmanager
def replace_file(path: str | Path) -> Iterator[Path]:
    """Give a file to write in place of `path`; it takes that name when the block ends without an error.

        with replace_file("rows.json") as temporary:
            temporary.write_text(text)

    The yielded path lies in the same folder (a rename does not cross disks), exists, is empty, and has the
    suffix of `path`, by which many writers choose their format. When the block raises, it is removed and
    `path` stays as it was. InputError when the folder cannot be written, the disk is full or `path` is itself a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; a file name is needed")
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(6)}{path.suffix}")
    try:
        # Not tempfile: its files are private (0600) and would stay so after the rename.
        temporary.open("xb").close()
    except OSError as error:
        reason = error.strerror or str(error)
        raise InputError(f"{path.parent}: cannot write into this folder ({reason.lower()})") from error
    try:
        yield temporary
        os.replace(temporary, path)
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise InputError(f"{path}: cannot be written ({os.strerror(error.errno).lower()})") from error
    finally:
        temporary.unlink(missing_ok=True)


def check_outputs(suffix: str, *files: Path | None) -> None:
    """Raise, before any work is done, the InputError that writing one of the files would end in.

    Each must end with `suffix`: what is written is of that format, whatever the name says.
    """

    class Probed(Exception):
        """The file could be written."""

    named = [file for file in files if file is not None]
    for file in named:
        if [other.resolve() for other in named].count(file.resolve()) > 1:
            raise InputError(f"{file}: is named twice; each output needs a file of its own")
        try:
            with replace_file(file):
                raise Probed
        except Probed:
            pass
        if file.suffix.lower() != suffix:
            raise InputError(f"{file}: found a name that ends with {file.suffix or 'no suffix'!r}; allowed: {suffix}")


def check_folder(folder: Path, own: str = "rows.jsonl") -> None:
    """Raise InputError where files lie in a folder, hidden ones aside, and not `own`, the one that tells it is ours."""
    try:
        found = sorted(file.name for file in folder.iterdir() if not file.name.startswith("."))
    except OSError:  # no such folder yet, or one that cannot be written either, which is told there
        return
    if found and own not in found:
        allowed = f"a new folder, an empty one, or one with {own}"
        raise InputError(f"{folder}: found other files, such as {found[0]:.60}; allowed: {allowed}")


def png_of(image: "NDArray[np.uint8]") -> bytes:
    """A (H, W, 3) sRGB or (H, W) grey image as the bytes of a PNG."""
    from PIL import Image

    held = io.BytesIO()
    Image.fromarray(image).save(held, format="PNG")
    return held.getvalue()
