"""Groups of options that the command line, the Python functions and study files share, and validation of arguments."""

import operator
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError


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


def as_list(value: Any, name: str, allowed: str, *types: type) -> list[Any]:
    """The values of a list, array or Series as a list, or a single value of the given types as a list of one."""
    if isinstance(value, types):
        return [value]
    values = list(value) if isinstance(value, Iterable) and not isinstance(value, str | bytes) else [value]
    for entry in values:
        if not isinstance(entry, types):
            raise _input_error(name, entry, allowed)
    return values


def whole_number(value: Any, name: str, bounds: Bounds) -> int:
    """The value, a whole number of any numeric library, as an int within bounds."""
    least, most = bounds
    try:
        number = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        number = None
    if number is None or not least <= number <= most:
        raise _input_error(name, value, f"whole numbers from {least} to {most}")
    return number


def whole_numbers(value: Any, name: str, bounds: Bounds) -> list[int]:
    """One or several whole numbers, as a list of ints; at least one."""
    entries = as_list(value, name, "whole numbers", int, np.integer)
    if not entries:
        raise InputError(f"{name}: found none; allowed: one or several, or None for the study's")
    return [whole_number(entry, name, bounds) for entry in entries]


def number(value: Any, name: str) -> float:
    """The value, a real number of any numeric library, as a float."""
    if isinstance(value, bool | str | bytes) or not hasattr(value, "__float__"):
        raise _input_error(name, value, "a number")
    return float(value)


def instance_of(value: Any, name: str, allowed: str, *types: type) -> Any:
    """The value unchanged, checked to be of one of the types."""
    if not isinstance(value, types):
        raise _input_error(name, value, allowed)
    return value


def as_visibility(value: Any, name: str, shape: tuple[int, ...]) -> NDArray[Any]:
    """A mask as visibility: floats and booleans unchanged, uint8 and uint16 divided by their maximum."""
    mask = np.asarray(value)
    integers = mask.dtype in (np.uint8, np.uint16)
    if np.ma.isMaskedArray(value) or not (integers or mask.dtype.kind in "bf"):
        raise InputError(
            f"{name}: found {type(value).__name__} of {mask.dtype}; "
            "allowed: an array of floats, booleans, uint8 or uint16"
        )
    if mask.shape != shape:
        raise InputError(f"{name}: found shape {mask.shape}; allowed: {shape}, that of the truth")
    if not integers:
        return mask
    if mask.max() == 1:
        raise InputError(f"{name}: found {mask.dtype} up to 1; allowed: up to its largest, which is lit")
    return mask / np.iinfo(mask.dtype).max


def _input_error(name: str, found: object, allowed: str) -> InputError:
    shown = f"{found!r:.60}".splitlines() or [""]
    return InputError(f"{name}: found {shown[0]} ({type(found).__name__}); allowed: {allowed}")
