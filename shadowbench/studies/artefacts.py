"""The artefacts of the gallery: for each a minimal scene, a setting that shows it, and one that cures it."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from shadowbench.files import data_folder


@dataclass(frozen=True)
class Artefact:
    """An artefact, and what a sheet says of it.

    chapter: the kind of technique that has it; scene: name of its scene file; metric: that detects it; broken, cured:
    specs; see, cause, cure, question: texts, in Markdown; source: of cause and cure; crop: left, top and side of the
    part of the picture that shows it best, in eighths of the picture; others: specs of other cures; sequence, frames:
    of an artefact of motion, the name of its sequence, and how many frames show it.
    """

    name: str
    chapter: str
    scene: str
    metric: str
    broken: str
    cured: str
    see: str
    cause: str
    cure: str
    question: str
    source: str
    crop: tuple[int, int, int] | None = None
    others: tuple[str, ...] = ()
    sequence: str | None = None
    frames: int = 1

    @property
    def file(self) -> Path:
        """Path of its scene file."""
        return folder() / f"{self.scene}.toml"


def folder() -> Path:
    """The folder of the scene files and of artefacts.toml."""
    return data_folder("docs/gallery")


@cache
def artefacts() -> tuple[Artefact, ...]:
    """All artefacts, chapter by chapter."""
    tables = tomllib.loads((folder() / "artefacts.toml").read_text(encoding="utf-8"))["artefact"]
    return tuple(Artefact(**table) for table in tables)
