"""Where the files that travel with the package are: shaders, built-in scenes, studies."""

import hashlib
from pathlib import Path

SOURCES = {".py", ".glsl", ".vert", ".geom", ".frag"}


def data_folder(kind: str) -> Path:
    """Folder of `kind` ("shaders", "scenes", "benchmarks"), in a wheel or in the repository.

    A wheel carries them under `shadowbench/_data/`; an editable install reads the repository's own.
    """
    package = Path(__file__).resolve().parent
    packed = package / "_data" / kind
    return packed if packed.is_dir() else package.parent / kind


def source_digest(*places: Path) -> str:
    """Hex digest of the text of files, and of all .py and GLSL files in folders: what a cached result rests on."""
    digest = hashlib.sha256()
    for place in places:
        files = sorted(path for path in place.rglob("*") if path.suffix in SOURCES) if place.is_dir() else [place]
        for file in files:
            digest.update(file.name.encode() + b"\0" + file.read_bytes() + b"\0")
    return digest.hexdigest()
