"""Which scenes a search tunes on and which it has not seen: one split, or folds that hold out every scene once."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.errors import InputError

_THIRD = 3  # of the scenes are held out where nothing is said


@dataclass(frozen=True)
class Fold:
    """Names of the scenes to tune on, and of those held out, in the order of the scenes."""

    tuning: tuple[str, ...]
    held_out: tuple[str, ...]


def folds(scenes: Sequence[str], held_out: Sequence[str] = (), count: int | None = None) -> list[Fold]:
    """One fold, with the scenes held out that are named; or `count`, in each of which every count-th is held out.

    Which ones follows from the order of the names' hashes. Without either it is the second of three folds. Raises
    InputError unless each has a scene of both kinds.
    """
    for name in held_out:
        if name not in scenes:
            raise InputError(f"--held-out: found {name!r:.60}; allowed are scenes that take part: {', '.join(scenes)}")
    if count is not None and not 2 <= count <= len(scenes):
        raise InputError(
            f"--folds: found {count}; allowed: 2 to the number of scenes that take part, {len(scenes)} "
            f"({', '.join(scenes) or 'none'})"
        )
    dealt = sorted(scenes, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    if count is not None:
        return [_fold(scenes, dealt[first::count]) for first in range(count)]
    return [_fold(scenes, held_out or dealt[1::_THIRD])]


def _fold(scenes: Sequence[str], held_out: Sequence[str]) -> Fold:
    """Raises InputError unless there is one of each."""
    tuning = tuple(name for name in scenes if name not in held_out)
    if not tuning or not held_out:
        raise InputError(
            f"--scenes: {len(tuning)} to tune on, {len(held_out)} held out ({', '.join(scenes) or 'none takes part'}); "
            "allowed: at least one of each"
        )
    return Fold(tuning, tuple(name for name in scenes if name in held_out))
