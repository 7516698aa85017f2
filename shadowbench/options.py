"""Groups of options that the command line, the Python functions and study files share, and the values they allow.

The checks at the end are of arguments of Python functions; each raises InputError.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields
from functools import partial
from numbers import Integral, Real
from pathlib import Path
from typing import Any, NamedTuple

from shadowbench.errors import InputError


class Bounds(NamedTuple):
    """The least and the greatest of the whole numbers that an option allows."""

    least: int
    most: int


MAP_SIZE = Bounds(1, 65536)
SIDE = Bounds(1, 16384)
"""Of a view's width and height, in pixels."""
ROUNDS = Bounds(0, 10_000)
PHASES = Bounds(1, 10_000)
FRAMES = Bounds(2, 300)
"""Of a sequence."""
PIXEL_SAMPLES = Bounds(1, 64)
KINDS = ("techniques", "engines", "scenes", "metrics", "studies", "axes", "devices")
"""What `list` lists."""
LATEST = 1e9
"""Largest time of an animation, in seconds."""
LARGEST = 1e18
"""Largest allowed coordinate: squares of larger ones overflow float32, which `coordinates="absolute"` uses."""


class ViewSize(NamedTuple):
    """Width and height of a view, in pixels. Its text is `512` for a square, else `1280x720`."""

    width: int
    height: int

    @classmethod
    def of(cls, value: "ViewSizeLike") -> "ViewSize":
        """From a whole number, of a square, or a text. Raises InputError."""
        text = str(value) if isinstance(value, (Integral, str, ViewSize)) and not isinstance(value, bool) else ""
        sides = [int(side) for side in text.split("x") if re.fullmatch("[0-9]{1,9}", side)]
        if len(sides) != 1 + text.count("x") or len(sides) > 2 or not all(SIDE.least <= n <= SIDE.most for n in sides):
            raise _wrong(value, "view_size", f"{SIDE.least} to {SIDE.most}, or WIDTHxHEIGHT, such as 1280x720")
        return cls(sides[0], sides[-1])

    def __repr__(self) -> str:
        return str(self.height) if self.width == self.height else f"{self.width}x{self.height}"

    @property
    def written(self) -> int | str:
        """The value as files and JSON have it, a number for a square."""
        return self.height if self.width == self.height else str(self)

    @property
    def columns(self) -> dict[str, int]:
        """The columns of a row."""
        return {"view_size": self.height, "view_width": self.width}

    @property
    def aspect(self) -> float:
        """Width over height; pixels are square."""
        return self.width / self.height

    @property
    def pixels(self) -> int:
        """Number of pixels."""
        return self.width * self.height

    @property
    def shape(self) -> tuple[int, int]:
        """Shape of arrays, (height, width)."""
        return self.height, self.width

    def times(self, factor: float) -> "ViewSize":
        """The size with both sides multiplied, rounded, at least 1."""
        return ViewSize(*(max(1, round(factor * side)) for side in self))


DEFAULT_SIZE = ViewSize(512, 512)
ViewSizeLike = ViewSize | int | str
"""What options, study files and functions take for a view's size."""


def option(
    help: str,
    metavar: str | None = None,
    *,
    default: Any = None,
    bounds: Bounds | None = None,
    parser: Callable[[str], Any] | None = None,
    names: tuple[str, ...] = (),
    heading: str | None = None,
) -> Any:
    """A field of a group: on the command line an option with this help, of which `metavar` stands for the value.

    bounds: what it allows; parser: of its text on the command line; names: there, by default that of the field;
    heading: of its help, if not that of the group.
    """
    metadata = {"help": help, "metavar": metavar, "bounds": bounds, "parser": parser, "names": names}
    return field(default=default, metadata=metadata | ({"rich_help_panel": heading} if heading else {}))


view_size = partial(
    option, "Size of the image in pixels: a square's side, or 1280x720  [512].", "N|WxH", parser=ViewSize.of
)


def coordinates(text: str, where: str) -> tuple[float, float, float]:
    """The point of a text `X,Y,Z`. Raises InputError that begins with `where`."""
    values = _numbers(text)
    if len(values) != 3 or not all(abs(value) <= LARGEST for value in values):
        raise InputError(
            f"{where}: found {text!r:.60}; allowed: three numbers X,Y,Z of at most {LARGEST:.0e} either way"
        )
    return values[0], values[1], values[2]


def azimuth_elevation(text: str) -> tuple[float, float]:
    """The angles in degrees of a text `AZIMUTH,ELEVATION`. Raises InputError."""
    values = _numbers(text)
    if len(values) != 2 or not (abs(values[0]) <= 360.0 and 0.0 < values[1] <= 90.0):
        raise InputError(
            f"--sun-at: found {text!r:.60}; allowed: AZIMUTH,ELEVATION in degrees, of up to 360 either way and above 0 "
            "up to 90"
        )
    return values[0], values[1]


def _numbers(text: str) -> list[float]:
    """The numbers of a comma-separated text; none if a part is no number."""
    try:
        return [float(part) for part in text.split(",")]
    except ValueError:
        return []


def in_python(line: str) -> str:
    """A line in which options have the names of parameters, as min_iou for --min-iou."""
    return re.sub(r"--([a-z][a-z-]*)", lambda match: match[1].replace("-", "_"), line)


def place_text(value: Any, name: str) -> str | None:
    """The text of an option: itself, or of the numbers of a list or array."""
    if value is None or isinstance(value, str):
        return value
    return ",".join(repr(number(one, name)) for one in as_list(value, name, "a text, or numbers", Real))


PLACES = ("camera", "target", "lamp", "sun_at")
"""Fields of `SceneOptions` that are a text, or numbers in Python and in files."""


@dataclass(frozen=True)
class SceneOptions:
    """How a scene is read."""

    assets: Path | None = option("Additional folder to search for a scene file's meshes.", "DIR")
    up: str | None = option("Up axis of OBJ, PLY, STL and OFF files, which do not specify it  [y].", "y|z")
    sun: bool = option(
        "Give directional lights without a size that of the sun: an angular radius of 0.2665°.", default=False
    )
    no_ground: bool = option(
        "Assume no ground below a mesh file that has none; the assumed one receives shadows that count.", default=False
    )
    time: float | None = option("Seconds at which the clip of an animated glTF poses it  [0].", "S")
    clip: str | None = option(
        "Clip of an animated glTF, by name or by number from 1, or none for its nodes as they stand  [the first].",
        "NAME",
    )
    camera: str | None = option(
        "Where the camera stands: a side of what the scene holds, inside for an interior, or a point in the scene's "
        "units. A camera of the scene with such a name is meant first  [the scene's own cameras].",
        "front|back|left|right|top|inside|X,Y,Z",
    )
    target: str | None = option("Point that --camera X,Y,Z looks at  [the middle of the scene].", "X,Y,Z")
    lamp: str | None = option("A point light there, in place of the scene's lights.", "X,Y,Z")
    sun_at: str | None = option(
        "A sun there, in place of the scene's lights: degrees from north (−z) clockwise as seen from above (+x is 90), "
        "and degrees above the horizon.",
        "AZIMUTH,ELEVATION",
    )

    def __post_init__(self) -> None:
        if self.time is not None:
            time = number(self.time, "time")
            if not 0.0 <= time <= LATEST:
                raise InputError(f"--time: found {time:g}; allowed: seconds from 0 to {LATEST:g}")
            object.__setattr__(self, "time", time)
        for name in PLACES:
            object.__setattr__(self, name, place_text(getattr(self, name), name))
        if self.camera and "," in self.camera:
            coordinates(self.camera, "--camera")
        elif self.target is not None:
            raise InputError(f"--target {self.target:.60}: is for --camera X,Y,Z, which is not given")
        if self.lamp is not None and self.sun_at is not None:
            raise InputError("found --lamp and --sun-at; allowed: one")
        for text, where in ((self.target, "--target"), (self.lamp, "--lamp")):
            if text is not None:
                coordinates(text, where)
        if self.sun_at is not None:
            azimuth_elevation(self.sun_at)

    def arguments(self) -> list[str]:
        """The options of the command line that read a scene in the same way."""
        words = []
        for one in fields(SceneOptions):
            value, name = getattr(self, one.name), f"--{one.name.replace('_', '-')}"
            words += [name] if value is True else [name, str(value)] if value else []
        return words


@dataclass(frozen=True)
class ViewOptions(SceneOptions):
    """Which view of a scene is meant, by the names of a camera and of a light."""

    view: str | None = option("Name of a camera of the scene  [the first].", "NAME")
    light: str | None = option("Name of a light of the scene  [the first; `run`: each].", "NAME")


FIRST = ViewOptions()


@dataclass(frozen=True)
class Measuring:
    """How a study is measured; None for its own value. Raises InputError."""

    view_size: ViewSize | None = view_size()
    rounds: int | None = option("Number of times that each cell is timed; 0 for no timing  [9].", "N", bounds=ROUNDS)
    phases: int | None = option(
        "Sub-texel offsets of the shadow map at which each cell is scored; with more than one, the table shows medians "
        "and intervals. Only the first is timed  [the study's; with -t and neither study nor --map-size, 1].",
        "N",
        bounds=PHASES,
    )
    sequence: str | None = option(
        "Draw each cell in the frames of a sequence, and score its motion against a truth of each frame: one of the "
        "scene's file, or dolly, pan, zoom, orbit, slow-sun, quick-sun, carried-lamp, moving-caster, walker, or all of "
        "these; several are separated by commas.",
        "NAME,...",
    )
    frames: int | None = option("How many frames of the sequence  [all, 24].", "N", bounds=FRAMES)

    def __post_init__(self) -> None:
        if self.view_size is not None:
            object.__setattr__(self, "view_size", ViewSize.of(self.view_size))
        for one in fields(self):
            value, bounds = getattr(self, one.name), one.metadata["bounds"]
            if bounds and value is not None:
                object.__setattr__(self, one.name, whole_number(value, one.name, bounds))


AS_STUDIED = Measuring()


def as_list(value: Any, name: str, allowed: str, *types: type) -> list[Any]:
    """The values of a list, array or Series as a list, or a single value of the given types as a list of one."""
    several = isinstance(value, Iterable) and not isinstance(value, (str, bytes, *types))
    return [instance_of(entry, name, allowed, *types) for entry in (value if several else [value])]


def whole_number(value: Any, name: str, bounds: Bounds) -> int:
    """The value, a whole number of any numeric library, as an int within bounds."""
    allowed = f"whole numbers from {bounds.least} to {bounds.most}"
    whole = int(instance_of(value, name, allowed, Integral))
    if isinstance(value, bool) or not bounds.least <= whole <= bounds.most:
        raise _wrong(value, name, allowed)
    return whole


def whole_numbers(value: Any, name: str, bounds: Bounds) -> list[int]:
    """One or several whole numbers, as a list of ints; at least one."""
    entries = as_list(value, name, "whole numbers", Integral)
    if not entries:
        raise InputError(f"{name}: found none; allowed: one or several, or None for the study's")
    return [whole_number(entry, name, bounds) for entry in entries]


def number(value: Any, name: str) -> float:
    """The value, a real number of any numeric library, as a float."""
    return float(instance_of(value, name, "a number", Real))


def instance_of(value: Any, name: str, allowed: str, *types: type) -> Any:
    """The value unchanged, checked to be of one of the types."""
    if not isinstance(value, types):
        raise _wrong(value, name, allowed)
    return value


def _wrong(value: Any, name: str, allowed: str) -> InputError:
    shown = f"{value!r:.60}".splitlines() or [""]
    return InputError(f"{name}: found {shown[0]} ({type(value).__name__}); allowed: {allowed}")
