"""Validation of arguments of the Python functions; raises InputError."""

import operator
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError
from shadowbench.options import Bounds


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
