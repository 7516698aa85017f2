"""Split of scenes into those tuned on and those held out for evaluation."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from shadowbench.errors import InputError

_THIRD = 3  # by default, every third scene is held out


@dataclass(frozen=True)
class SceneSplit:
    """Names of the tuning and the held-out scenes, in the order of the scenes."""

    tuning: tuple[str, ...]
    held_out: tuple[str, ...]


def split_scenes(scenes: Sequence[str], held_out: Sequence[str] = ()) -> SceneSplit:
    """Hold out the named scenes, by default every third in the order of the names' hashes.

    Raises InputError for an unknown name, and unless both parts have a scene.
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
    return SceneSplit(tuning, tuple(name for name in scenes if name in kept))
