"""Groups of options that the command line, the Python functions and study files share, and the values they allow."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple


class Bounds(NamedTuple):
    """The least and the greatest of the whole numbers that an option allows."""

    least: int
    most: int


MAP_SIZE = Bounds(1, 65536)
VIEW_SIZE = Bounds(1, 16384)
ROUNDS = Bounds(0, 10_000)
PHASES = Bounds(1, 10_000)
PIXEL_SAMPLES = Bounds(1, 64)


@dataclass(frozen=True)
class SceneOptions:
    """How a scene is read.

    assets: additional folder to search for a scene file's meshes; up: up axis, y or z, of mesh formats that do not
    specify it; sun: give directional lights without a size that of the sun; no_ground: assume no ground.
    """

    assets: Path | None = None
    up: str | None = None
    sun: bool = False
    no_ground: bool = False


@dataclass(frozen=True)
class ViewOptions(SceneOptions):
    """Which view of a scene is meant: the names of a camera and of a light, None for its first."""

    view: str | None = None
    light: str | None = None


FIRST = ViewOptions()


@dataclass(frozen=True)
class Measuring:
    """How a study is measured; None for its own value.

    view_size: pixels along a side; rounds: how often each cell is timed, 0 for no timing; phases: subtexel offsets of
    the map at which it is scored; step: camera or light, which moves a little so that flips can be counted.
    """

    view_size: int | None = None
    rounds: int | None = None
    phases: int | None = None
    step: str | None = None


AS_STUDIED = Measuring()
