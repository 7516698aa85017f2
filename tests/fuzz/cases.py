"""One generated input: the files of a folder, and the one given to shadowbench."""

from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
OUTSIDE = "outside"
"""A folder beside the case's own; whatever is read of it was stolen."""
INSIDE = "inside"
ASSETS = "assets"
OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"


@dataclass(frozen=True)
class Case:
    """`kind` is scene, study, spec or a mesh format; `files` are bytes by path, `links` targets by path.

    `text` is what is read of a spec, which has no file.
    """

    kind: str
    main: str
    files: dict[str, bytes] = field(default_factory=dict)
    links: dict[str, str] = field(default_factory=dict)
    text: str = ""

    def write(self, root: Path) -> Path:
        """Write the case below `root`, into folders inside, assets and outside; returns its main file."""
        for folder in (INSIDE, ASSETS, OUTSIDE):
            (root / folder).mkdir(parents=True)
            (root / folder / "part.obj").write_bytes(OBJ)
        (root / OUTSIDE / "part.bin").write_bytes(b"\0" * 4096)
        for name, data in self.files.items():
            (root / INSIDE / name).write_bytes(data)
        for name, target in self.links.items():
            (root / INSIDE / name).symlink_to(target)
        return root / INSIDE / self.main
