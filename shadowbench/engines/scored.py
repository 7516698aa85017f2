"""What another renderer handed over, checked and scored against the truth of its view."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.difference import difference_picture
from shadowbench.engines.encoding import Reading, reading_of
from shadowbench.engines.kinds import Kind, kinds_of, wrong_pixels
from shadowbench.engines.orientation import misorientation
from shadowbench.engines.pictures import Handed
from shadowbench.engines.shift import shift_of
from shadowbench.errors import InputError
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scenes.model import View
from shadowbench.scores.comparison import Comparison
from shadowbench.truths.cache import cached_truth

_NOTED_CLIPPED = 0.01
"""Share of the scored pixels that may be cut off before it is said."""
_ALIKE_IOU, _COMMON = 0.2, 0.5
"""IoU, and share of the smaller shadow in common, below which a mask may be of something else. Three in four masks of
another built-in scene are, at 256²; none of our techniques' were, the one without a bias among them."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """A mask beside its truth. `record` is what a score record says of it, `comparison` what it was made from."""

    handed: Handed
    view: View
    comparison: Comparison
    record: dict[str, Any]
    warnings: tuple[str, ...]

    @property
    def metrics(self) -> dict[str, float | None]:
        """Every metric by name; None where there is nothing to divide by."""
        found: dict[str, float | None] = self.record["metrics"]
        return found

    @cached_property
    def kinds(self) -> list[Kind]:
        """What is wrong, most pixels first."""
        return kinds_of(self.comparison, self.metrics)

    @cached_property
    def wrong(self) -> tuple[int, int]:
        """Pixels of false shadow and of false light."""
        false_shadow, false_light = wrong_pixels(self.comparison)
        return int(np.count_nonzero(false_shadow)), int(np.count_nonzero(false_light))

    def values(self) -> dict[str, Any]:
        """All that is known of it, as JSON has it."""
        false_shadow, false_light = self.wrong
        return {
            "scene": self.view.scene.name,
            "view": self.view.camera.name,
            "light": self.view.light.name,
            "view_size": self.view.size,
            **self.record,
            "false_shadow": false_shadow,
            "false_light": false_light,
            "errors": [{"kind": kind.name, "pixels": kind.pixels, "line": kind.line} for kind in self.kinds],
        }

    def difference(self) -> NDArray[np.uint8]:
        """(N, N, 3) sRGB: false shadow orange, false light blue."""
        return difference_picture(self.comparison)

    def summary(self) -> list[str]:
        """Some lines about what is wrong, for people."""
        false_shadow, false_light = self.wrong
        scored = self.comparison.truth.pixels
        lines = [f"{scored} pixels scored: {false_shadow} of false shadow, {false_light} of false light"]
        if unmeasured := self.record["input"]["unmeasured"]:
            lines.append(f"{unmeasured} more not scored: lit and ambient picture differ there by less than 1/64")
        lines += [f"{kind.name}, {kind.pixels} px: {kind.line}" for kind in self.kinds]
        return lines


def accuracy_of(handed: Handed, view: View) -> Accuracy:
    """Score what was handed over, as it is, against the view's truth, which is traced or taken from the cache.

    A shift, an encoding, a shadow that is not 0 or a cut-off picture is a warning and a field of `record["input"]`.
    InputError for what is flipped or inverted, and for screenshots that are dark wherever there is something to score.
    """
    truth = cached_truth(view)
    unmeasured = 0
    if handed.measurable is not None:
        unmeasured = int(np.count_nonzero(truth.receivers & ~truth.undecided & ~handed.measurable))
        truth = replace(truth, receivers=truth.receivers & handed.measurable)
    prepared = prepare_truth(truth)
    if unmeasured and not prepared.pixels:
        raise InputError(
            f"{handed.name}: lit − ambient is below 1/64 in every pixel; allowed: a lit picture of the view"
        )
    if fault := misorientation(handed.visibility, prepared):
        raise InputError(
            f"{handed.name}: is {fault}, against the truth of {view.scene.name}; "
            "allowed: row 0 at the top, column 0 at the left, full = lit, 0 = in shadow"
        )
    comparison = Comparison(handed.visibility, prepared)
    # Screenshots are decoded already.
    reading = reading_of(comparison) if handed.measurable is None else Reading(shift_of(comparison))
    clipped = 0 if handed.clipped is None else int(np.count_nonzero(handed.clipped & prepared.valid))
    warnings = []
    if reading.shift is not None:
        warnings.append(f"seems shifted by {_told(reading.shift)}; scored as it is")
    if reading.umbra is not None:
        warnings.append(f"its shadow is {reading.umbra:.2f}, not 0; scored as it is")
    if reading.encoded:
        warnings.append("seems to be sRGB-encoded (its soft values are too light for a linear mask); scored as it is")
    if (line := _uniform(comparison)) is not None:
        warnings.append(line)
    if seems_of_another(comparison):
        warnings.append("has little in common with the truth; is it a mask of this scene, view and light?")
    if clipped > _NOTED_CLIPPED * prepared.pixels:
        share = clipped / prepared.pixels
        warnings.append(f"the lit picture is at full in {share:.1%} of the scored pixels and may be cut off there")
    given = {
        "source": "mask" if handed.measurable is None else "screenshots",
        "shift_px": reading.shift,
        "srgb_encoded": reading.encoded,
        "umbra": reading.umbra,
        "unmeasured": unmeasured,
        "clipped": clipped,
        "warnings": warnings,
    }
    record = {**mask_record(handed.visibility, truth, prepared), "input": given}
    return Accuracy(handed, view, comparison, record, tuple(f"{handed.name}: {line}" for line in warnings))


def _uniform(comparison: Comparison) -> str | None:
    """A warning for a truth, else a mask, that is lit or in shadow in every scored pixel."""
    pixels = comparison.truth.pixels
    for whose, shadow in (("in this view the truth", comparison.truth.shadow), ("the mask", comparison.shadow)):
        count = int(np.count_nonzero(shadow))
        if pixels and count in (0, pixels):
            return f"{whose} is {'in shadow' if count else 'lit'} in every scored pixel, so most metrics say little"
    return None


def seems_of_another(comparison: Comparison) -> bool:
    """Whether a mask's shadow and the truth's are there, and lie beside each other."""
    mask, truth = comparison.shadow, comparison.truth.shadow
    common, smaller = np.count_nonzero(mask & truth), min(np.count_nonzero(mask), np.count_nonzero(truth))
    return bool(common < _COMMON * smaller and common < _ALIKE_IOU * np.count_nonzero(mask | truth))


def _told(shift: tuple[float, float]) -> str:
    across, down = shift
    parts = [(across, "to the right", "to the left"), (down, "down", "up")]
    return " and ".join(
        f"{abs(value):.2f} px {forth if value > 0 else back}" for value, forth, back in parts if abs(value) >= 0.05
    )
