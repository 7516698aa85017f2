"""Which scenes a search tunes on, and which it has not seen."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.errors import InputError

_THIRD = 3  # of the scenes are held out where nothing is said


@dataclass(frozen=True)
class Split:
    """Names of the scenes to tune on, and of those held out, in the order of the scenes."""

    tuning: tuple[str, ...]
    held_out: tuple[str, ...]


def split_of(scenes: Sequence[str], held_out: Sequence[str] = ()) -> Split:
    """The named scenes held out, or every third by the order of the names' hashes.

    Raises InputError unless there is a scene of both kinds.
    """
    for name in held_out:
        if name not in scenes:
            raise InputError(f"--held-out: found {name!r:.60}; allowed are scenes that take part: {', '.join(scenes)}")
    dealt = sorted(scenes, key=lambda name: hashlib.sha256(name.encode()).hexdigest())
    kept = held_out or dealt[1::_THIRD]
    tuning = tuple(name for name in scenes if name not in kept)
    if not tuning or not kept:
        raise InputError(
            f"--scenes: {len(tuning)} to tune on, {len(kept)} held out ({', '.join(scenes) or 'none takes part'}); "
            "allowed: at least one of each"
        )
    return Split(tuning, tuple(name for name in scenes if name in kept))
