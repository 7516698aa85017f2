"""When the layers of a map are redrawn, and what those that are not were drawn with."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np

from shadowbench.plugin.base import Frame
from shadowbench.plugin.params import Component, param
from shadowbench.plugin.stage import Stage
from shadowbench.scenes.model import Light
from shadowbench.scenes.vectors import Floats

T = TypeVar("T")


class Update(Component):
    """Base class of when maps are redrawn, in the frames of a sequence. In its first frame all are.

    Until then a map is looked up as it was drawn: with the light and the window of that frame, from the new camera.
    compares: whether a layer is left as it is if light, window and casters are.
    """

    compares: ClassVar[bool] = False

    def due(self, index: int, layer: int) -> bool:
        """Whether a layer may have to be redrawn in a frame."""
        return True

    def kept(self, stage: Stage, name: str, make: Callable[[], T]) -> T:
        """What `make` returns, remembered from frame to frame unless maps are always redrawn."""
        return stage.remembered(name, make) if self.remembers else make()


class Always(Update):
    """In every frame."""

    name = "always"
    unwritten = True


class Every(Update):
    """In every n-th frame: shadows lag behind light and casters by up to n − 1 frames, and end where the camera goes.

    With `stagger`, cascades take turns: the i-th is redrawn in the frames k with k ≡ i modulo n.
    """

    name = "every"
    remembers = True
    n: int = param(2, "frames from one redraw to the next", ge=1, le=1024)
    stagger: bool = param(False, "cascades take turns")

    def due(self, index: int, layer: int) -> bool:
        return (index - layer * self.stagger) % self.n == 0


class Needed(Update):
    """Where light, window or casters are others than when it was drawn: the same shadows as always, for less.

    A window that follows the camera is another in each frame, unless it moves by whole texels.
    """

    name = "needed"
    remembers = True
    compares = True


@dataclass(frozen=True, eq=False)
class Layer(Generic[T]):
    """What a layer was drawn with: in a frame, under a light, with a window that `key` tells from others."""

    index: int
    light: Light
    window: T
    key: Any


class Layers(Generic[T]):
    """The layers of a map, each as drawn in this frame or, by the map's update, in an earlier one.

    together: whether one draw redraws all.
    """

    def __init__(self, stage: Stage, update: Update, count: int = 1, together: bool = False) -> None:
        self._update, self._all, self._together = update, range(count), together
        self._drawn: dict[int, Layer[T]] = update.kept(stage, "layers", dict)
        if update.compares:
            kept: dict[str, Floats] = stage.remembered("casters", dict)
            casters = stage.scene.geometry.vertices[stage.scene.geometry.caster_faces]
            if not np.array_equal(casters, kept.setdefault("corners", casters)):
                kept["corners"] = casters
                self._drawn.clear()

    def redrawn(self, frame: Frame, fit: Callable[[], Sequence[tuple[T, Any]]]) -> list[int]:
        """Which layers must be drawn in a frame. fit: each layer's window and key; called if any is due."""
        drawn, update = self._drawn, self._update
        if frame.index == 0:
            drawn.clear()
        due = [layer for layer in self._all if layer not in drawn or update.due(frame.index, layer)]
        if not due:
            return []
        fitted = [Layer(frame.index, frame.light, *window) for window in fit()]
        if update.compares:
            due = [n for n in due if n not in drawn or not _same(drawn[n], fitted[n])]
        if due and self._together:
            due = list(self._all)
        drawn.update((layer, fitted[layer]) for layer in due)
        return due

    @property
    def windows(self) -> list[T]:
        """Each layer's window."""
        return [self._drawn[layer].window for layer in self._all]

    def looked_up(self, frame: Frame) -> Frame:
        """A frame under the light of the layer that was redrawn last."""
        light = max((self._drawn[layer] for layer in self._all), key=lambda layer: layer.index).light
        return replace(frame, view=replace(frame.view, light=light))


def _same(one: Layer[T], other: Layer[T]) -> bool:
    return one.light == other.light and np.array_equal(one.key, other.key)
