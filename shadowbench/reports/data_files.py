"""Data of an HTML page in scripts beside it, which the page loads when it shows them.

A page that is opened from a disk may run scripts beside it, but read no other files there: each script calls `deliver`
with its name and its value.
"""

import hashlib
import json
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


class DataFiles:
    """Scripts in a folder, named in the page by the folder's final name; written from any thread."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, name

    def write(self, identity: str, value: Any) -> str:
        """Write a JSON value, and return the name by which the page loads it; equal identities share a file."""
        name = f"{self.name}/{hashlib.sha256(identity.encode(errors='replace')).hexdigest()[:16]}.js"
        text = f"deliver({json.dumps(name)}, {json.dumps(value)});\n"
        (self.folder / Path(name).name).write_text(text, encoding="utf-8")
        return name


@contextmanager
def replaced_folder(folder: Path) -> Iterator[DataFiles]:
    """Yield data files that replace those of a folder, if any, when the block ends without an error."""
    beside = folder.with_name(f".{folder.name}.{secrets.token_hex(6)}")
    beside.mkdir(parents=True)
    try:
        yield DataFiles(beside, folder.name)
        shutil.rmtree(folder, ignore_errors=True)
        beside.rename(folder)
    finally:
        shutil.rmtree(beside, ignore_errors=True)
