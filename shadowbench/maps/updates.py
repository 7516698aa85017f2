"""When a map is redrawn, and what it was drawn with until then."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from shadowbench.plugin.base import Frame
from shadowbench.plugin.params import Component, param
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.model import Light

T = TypeVar("T")


class Update(Component):
    """Base class of when maps are redrawn in a sequence of frames; in the first they are.

    Until then a map is looked up as it was drawn, with the light and the window of that frame, from the new camera.
    compares: whether it is redrawn only if light, window or casters are others.
    """

    compares: ClassVar[bool] = False

    def due(self, index: int) -> bool:
        """Whether a frame may redraw the map."""
        return True

    def kept(self, stage: Stage, name: str, make: Callable[[], T]) -> T:
        """What `make` returns, remembered if maps are."""
        return stage.remembered(name, make) if self.remembers else make()


class Always(Update):
    """In every frame."""

    name = "always"
    unwritten = True


class Every(Update):
    """In every n-th frame: shadows lag behind light and casters by up to n − 1 frames, and end where the map did."""

    name = "every"
    remembers = True
    n: int = param(2, "frames from one redraw to the next", ge=1, le=1024)

    def due(self, index: int) -> bool:
        return index % self.n == 0


class Needed(Update):
    """Where light, window or casters are others than in the frame before: the same shadows as always, for less.

    A window that follows the camera, or is jittered by a history, is another in each frame.
    """

    name = "needed"
    remembers = True
    compares = True


@dataclass(frozen=True, eq=False)
class _Drawn(Generic[T]):
    light: Light
    window: T
    others: tuple[Any, Any]  # arrays of what else the depths depend on: `fit`'s, and the casters


class LastDraw(Generic[T]):
    """What a map was drawn with: in this frame or, by its update, in an earlier one."""

    def __init__(self, stage: Stage, update: Update) -> None:
        self._update, geometry = update, stage.scene.geometry
        self._casters = geometry.vertices[geometry.caster_faces] if update.compares else np.zeros(0)
        self._kept: dict[str, _Drawn[T]] = update.kept(stage, "drawn", dict)

    def redraws(self, frame: Frame, fit: Callable[[], tuple[T, Any]]) -> bool:
        """Whether a frame draws the map. fit: its window there, and what the depths depend on, as an array."""
        last = self._kept.get("last") if frame.index else None
        if last and not self._update.due(frame.index):
            return False
        window, depends = fit()
        now = self._kept["last"] = _Drawn(frame.light, window, (depends, self._casters))
        same = last and last.light == now.light and all(map(np.array_equal, last.others, now.others))
        return not (same and self._update.compares)

    @property
    def window(self) -> T:
        """The map's window."""
        return self._kept["last"].window

    def looked_up(self, frame: Frame) -> Frame:
        """A frame under the light of the map."""
        return replace(frame, view=replace(frame.view, light=self._kept["last"].light))
