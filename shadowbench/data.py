"""Location of the package's data files: shaders, built-in scenes, studies."""

from pathlib import Path

PACKAGE = Path(__file__).resolve().parent


def data_folder(kind: str) -> Path:
    """Folder of data files of a kind: "shaders", "scenes" or "benchmarks".

    In a wheel they lie in `shadowbench/_data/`; an editable install uses the repository's folders.
    """
    packed = PACKAGE / "_data" / kind
    return packed if packed.is_dir() else PACKAGE.parent / kind
