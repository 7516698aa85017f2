"""Where the files that travel with the package are: shaders, built-in scenes, studies."""

from pathlib import Path


def data_folder(kind: str) -> Path:
    """Folder of `kind` ("shaders", "scenes", "benchmarks"), in a wheel or in the repository.

    A wheel carries them under `shadowbench/_data/`; an editable install reads the repository's own.
    """
    package = Path(__file__).resolve().parent
    packed = package / "_data" / kind
    return packed if packed.is_dir() else package.parent / kind
