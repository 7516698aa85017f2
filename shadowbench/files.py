"""Files: the package's data, and atomic replacement, so that readers see the old file or the complete new one."""

import errno
import io
import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from shadowbench.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Error numbers of a full disk, an exhausted quota or a file size limit."""

_TEMPORARY = re.compile(r"\..*\.[0-9a-f]{12}(\.\w+)?")


@contextmanager
def replace_file(path: str | Path) -> Iterator[Path]:
    """Yield a temporary file that replaces `path` when the block ends without an error.

        with replace_file("rows.json") as temporary:
            temporary.write_text(text)

    The yielded path lies in the same folder (a rename does not cross disks), exists, is empty, and has the suffix of
    `path`, by which many writers choose their format. If the block raises, it is removed and `path` is unchanged.
    Raises InputError if the folder cannot be written, the disk is full or `path` is itself a folder.
    """
    path = Path(path)
    if path.is_dir():
        raise InputError(f"{path}: is a folder; a file name is needed")
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(6)}{path.suffix}")
    try:
        # Not tempfile, whose files are private (0600) and would remain so after the rename.
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


def remove_temporaries(folder: Path) -> None:
    """Remove what killed programs left of `replace_file`; only while no other program writes into the folder."""
    for file in folder.glob(".*"):
        if _TEMPORARY.fullmatch(file.name):
            file.unlink(missing_ok=True)


def check_outputs(suffix: str, *files: Path | None) -> None:
    """Raises InputError if one of the files cannot be written later, is named twice, or does not end with `suffix`."""

    class Probed(Exception):
        """Raised to undo a successful test."""

    seen = set[Path]()
    for file in filter(None, files):
        if file.resolve() in seen:
            raise InputError(f"{file}: is named twice; each output needs a file of its own")
        seen.add(file.resolve())
        with suppress(Probed), replace_file(file):
            raise Probed
        if file.suffix.lower() != suffix:
            raise InputError(f"{file}: found a name that ends with {file.suffix or 'no suffix'!r}; allowed: {suffix}")


def make_folder(folder: Path, option: str = "") -> None:
    """Create a folder if it is missing. Raises InputError, which names the option that asked for it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{option}{folder}: cannot be created ({error.strerror or error})") from None


def check_folder(folder: Path, own: str = "rows.jsonl") -> None:
    """Raises InputError if a folder has visible files but not `own`, by which our folders are recognised."""
    try:
        names = sorted(file.name for file in folder.iterdir() if not file.name.startswith("."))
    except OSError:  # no such folder yet, or an unreadable one, for which writing will raise
        return
    if names and own not in names:
        allowed = f"a new folder, an empty one, or one with {own}"
        raise InputError(f"{folder}: found other files, such as {names[0]:.60}; allowed: {allowed}")


def png_of(image: "NDArray[np.uint8]") -> bytes:
    """PNG bytes of a (H, W, 3) sRGB, (H, W, 4) sRGB with alpha, or (H, W) grey uint8 image."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(image).save(stream, format="PNG")
    return stream.getvalue()


def read_beside(name: str, folder: Path, where: str) -> bytes:
    """The bytes of a file in a folder or below, as another file there names it, with slashes of either kind.

    Raises InputError that begins with `where` for one that is not there.
    """
    folder = folder.resolve()
    try:
        file = Path(os.path.realpath(folder / name.replace("\\", "/")))
        inside, there = file.is_relative_to(folder), file.is_file()
    except (OSError, ValueError):  # a null byte, a name too long
        inside, there = True, False
    if not inside or not there:
        wrong = "is not a file in" if inside else "leads outside"
        raise InputError(f"{where} {wrong} {folder}; allowed are files in it")
    return file.read_bytes()


PACKAGE = Path(__file__).resolve().parent


def data_folder(kind: str) -> Path:
    """Folder of data files of a kind: "shaders", "scenes", "benchmarks" or "docs/gallery".

    In a wheel they lie in `shadowbench/_data/`; an editable install uses the repository's folders.
    """
    packed = PACKAGE / "_data" / kind
    return packed if packed.is_dir() else PACKAGE.parent / kind


def cache_folder(kind: str) -> Path:
    """Folder of what is kept of a kind, "truth" or "engines"; it may not exist.

    It is in $SHADOWBENCH_CACHE, else in $XDG_CACHE_HOME/shadowbench, else in ~/.cache/shadowbench.
    """
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return Path(os.environ.get("SHADOWBENCH_CACHE") or f"{caches}/shadowbench") / kind
