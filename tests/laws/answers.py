"""Masks of techniques and truths for a view, and the pixels that depend on rounding."""

from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.gl.clock import Clock
from shadowbench.gl.gbuffer import download
from shadowbench.measure.scoring import prepare_truth
from shadowbench.plugin.base import Frame, Phase, Stage
from shadowbench.plugin.registry import shader_folder
from shadowbench.plugin.spec import Spec
from shadowbench.scenes.model import Light, View
from shadowbench.scenes.vectors import perpendicular_basis, unit, vec3
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.metrics import iou
from shadowbench.truths.trace import trace

NUDGE = 1 / 256  # of a pixel or texel: the rasteriser's sub-pixel grid, as in the truth's definition of undecided
DIAGONALS = list(product((-NUDGE, NUDGE), repeat=2))


@dataclass(frozen=True, eq=False)
class Answer:
    """Arrays of one view, (size, size), row 0 at the top: visibility, decided pixels, visible triangles."""

    visibility: NDArray[np.float32]
    decided: NDArray[np.bool_]
    triangle: NDArray[np.int32]

    @property
    def shadow(self) -> NDArray[np.bool_]:
        return self.visibility < 0.5


class Nudged(Phase):
    """A phase slightly shifted from that of its index."""

    def __init__(self, x: float, y: float) -> None:
        super().__init__(0)
        object.__setattr__(self, "_beside", (x, y))

    @property
    def shift(self) -> tuple[float, float]:
        return self._beside


def traced(view: View) -> Answer:
    truth = trace(view, pixel_samples=1)
    return Answer(truth.visibility, ~truth.undecided, truth.triangle)


class Drawing:
    """A technique on the device, built for the scene of one view."""

    def __init__(self, studio: Any, spec: Spec, view: View) -> None:
        self.studio, self.view, self.shot = studio, view, studio.shot(view)
        self.spec = spec
        shot, own = self.shot, self.spec.technique
        size = (view.size, view.size)
        self.stage = Stage(shot.view.scene, studio.device, size, shot.geometry, shot.placement, shader_folder(own))
        self.technique = own(self.spec.params)
        self.technique.build(self.stage)
        self.clock = Clock(studio.device)

    def __enter__(self) -> "Drawing":
        return self

    def __exit__(self, *_: object) -> None:
        self.stage.release()

    def visibility(self, view: View | None = None, phase: Phase | None = None) -> NDArray[np.float32]:
        """Visibility of the view, or of another view of its scene."""
        shot = self.shot if view is None else self.studio.shot(view)
        frame = Frame(shot.view, phase or Phase(), 0, shot.surface, self.clock)
        return download(self.technique.draw(frame))[..., 0].astype(np.float32)

    def answer(self) -> Answer:
        """Decided is what stays on its side of ½ when the picture's grid is nudged along its diagonals, and the map's.

        A boundary nearer to the pixel's centre than that, of a shadow, a texel or an equal depth, parts two of five.
        """
        plain = self.visibility()
        nudged = [self.visibility(replace(self.view, camera=aside(self.view, x, y))) for x, y in DIAGONALS]
        if self.technique.phased:
            nudged += [self.visibility(phase=Nudged(x, y)) for x, y in DIAGONALS]
        elif self.view.light.kind != "directional":
            texels = self.spec.map_size or self.view.size
            lamps = [lamp_aside(self.view, x, y, texels) for x, y in DIAGONALS]
            nudged += [self.visibility(replace(self.view, light=lamp)) for lamp in lamps]
        decided = np.all([(other < 0.5) == (plain < 0.5) for other in nudged], axis=0)
        return Answer(plain, decided, self.shot.triangle)

    def by_nudge(self) -> NDArray[np.float32]:
        """How much visibility changes at most when the map's grid is nudged along its diagonals."""
        plain = self.visibility()
        changes = [np.abs(self.visibility(phase=Nudged(x, y)) - plain) for x, y in DIAGONALS]
        return np.asarray(np.max(changes, axis=0), np.float32)

    def errors(self, phases: int) -> list[float]:
        """1 − IoU in the first phases."""
        prepared = prepare_truth(trace(self.view, pixel_samples=1))
        found = [iou(Comparison(self.visibility(phase=Phase(k)), prepared)) for k in range(phases)]
        return [1 - agreed for agreed in found if agreed is not None]


def aside(view: View, x: float, y: float) -> Any:
    """The camera rotated by fractions of a pixel."""
    camera = view.camera
    right, up, _ = camera.basis()
    toward = np.subtract(camera.target, camera.position)
    pixel = 2 * np.tan(camera.fov_y / 2) / view.size * np.linalg.norm(toward)
    return replace(camera, target=vec3(camera.target + pixel * (x * right + y * up)))


def lamp_aside(view: View, x: float, y: float, texels: int) -> Light:
    """The lamp moved by fractions of a texel."""
    light = view.light
    low, high = view.scene.geometry.bounds
    toward = np.array(light.position) - (low + high) / 2
    right, up, _ = perpendicular_basis(unit(toward), (0.0, 1.0, 0.0))
    texel = 2 * np.linalg.norm(toward) / texels
    return replace(light, position=vec3(light.position + texel * (x * right + y * up)))
