"""What the window and the process that traces send each other."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shadowbench.scenes.model import View


@dataclass(frozen=True, eq=False)
class Request:
    """A view to trace, unless it was the last one, and masks to score, by spec.

    number: of the request, which its answers carry; of_view: equal for requests of the same view.
    """

    number: int
    of_view: int
    view: View
    masks: Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True, eq=False)
class Traced:
    """What the window shows of a truth: arrays (N, N), row 0 at the top, as those of `Truth`.

    scored: receivers that are not undecided; soft: whether there is a penumbra; final: whether it is the full truth.
    """

    number: int
    visibility: NDArray[np.float32]
    scored: NDArray[np.bool_]
    blocker: NDArray[np.float32]
    soft: bool
    final: bool


@dataclass(frozen=True, eq=False)
class Scored:
    """The scores of a spec's mask in a view."""

    number: int
    spec: str
    scores: Mapping[str, float | None]


@dataclass(frozen=True, eq=False)
class Failed:
    """Why a view cannot be traced or a mask not scored."""

    number: int
    reason: str


Answer = Traced | Scored | Failed
