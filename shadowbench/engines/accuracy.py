"""Scoring a mask of another renderer against the truth of its view, with checks for common mistakes."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.engines.difference import difference_picture
from shadowbench.engines.encoding import MaskEncoding, detect_encoding
from shadowbench.engines.error_kinds import ErrorKind, error_kinds, wrong_pixels
from shadowbench.engines.external_mask import ExternalMask
from shadowbench.engines.orientation import misorientation
from shadowbench.engines.shift import estimate_shift, shift_text
from shadowbench.engines.soft_error_kinds import soft_error_kinds
from shadowbench.errors import InputError
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.scenes.model import View
from shadowbench.scores.comparison import Comparison
from shadowbench.scores.masks import LEVELS
from shadowbench.scores.metrics import METRICS
from shadowbench.truths.cache import cached_truth

_ROUNDING = 1 / (255 * math.sqrt(12))  # root mean square, of 8 bits
_RMSE = ("rmse", "rmse_pen")
_NOTED_CLIPPED = 0.01
"""Share of clipped pixels among the scored ones above which a warning is given."""
_GREY = (0.1, 0.9)
_SOFT_EDGE = 4.0
"""Grey pixels per pixel of the true edge above which a mask is softer than antialiasing or a small filter makes it."""
_ALIKE_IOU, _COMMON = 0.2, 0.5
"""IoU, and common share of the smaller shadow, below which a mask may be of another scene. At 256², three in four masks
of other built-in scenes are below, and none of the built-in techniques', even without bias."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Scores of a mask of another renderer; record: fields of its score record; comparison: mask and truth."""

    external: ExternalMask
    view: View
    comparison: Comparison
    record: dict[str, Any]
    warnings: tuple[str, ...]

    @property
    def metrics(self) -> dict[str, float | None]:
        """All metrics by name; None if a denominator is 0."""
        found: dict[str, float | None] = self.record["metrics"]
        return found

    @cached_property
    def kinds(self) -> list[ErrorKind]:
        """Kinds of error: of hard shadows, most pixels first; of soft ones, causes before symptoms."""
        if not self.comparison.truth.soft:
            return error_kinds(self.comparison, self.metrics)
        found = self.record["input"]
        return soft_error_kinds(
            self.comparison, self.metrics, MaskEncoding(found["shift_px"], found["srgb_encoded"], found["umbra"])
        )

    @cached_property
    def wrong(self) -> tuple[int, int]:
        """Numbers of pixels of false shadow and of false light."""
        false_shadow, false_light = wrong_pixels(self.comparison)
        return int(np.count_nonzero(false_shadow)), int(np.count_nonzero(false_light))

    def values(self) -> dict[str, Any]:
        """JSON object of `score --json`."""
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
        """Picture of the errors: false shadow orange, false light blue (see `difference_picture`)."""
        return difference_picture(self.comparison)

    def summary(self) -> list[str]:
        """Lines of text about the errors."""
        if soft := self.comparison.truth.soft:
            error, inside = (METRICS[name].text(self.metrics[name], "{:.2g}".format, self.record) for name in _RMSE)
            told = f"RMSE {error}, in the penumbra {inside}"
        else:
            false_shadow, false_light = self.wrong
            told = f"{false_shadow} of false shadow, {false_light} of false light"
        lines = [f"{self.comparison.truth.pixels} pixels scored: {told}"]
        if unmeasured := self.record["input"]["unmeasured"]:
            lines.append(f"{unmeasured} more not scored: lit and ambient picture differ there by less than 1/64")
        lines += [f"{kind.name}, {kind.pixels} px: {kind.line}" for kind in self.kinds]
        if (penumbra := self.record.get("penumbra")) is not None:
            error, inside, share = (self.record[name] for name in ("truth_error", "truth_error_pen", "width_share"))
            lines.append(
                f"penumbra, {penumbra} px: the truth's own error is {inside:.2g} there, {error:.2g} over all pixels"
            )
            if share is not None:
                lines.append(f"widths of penumbrae are compared at {share:.0%} of the true edge")
        if soft and _eight_bit(self.comparison):
            lines.append(f"the mask has 8 bits: rounding makes an RMSE of {_ROUNDING:.2g} in the penumbra")
        if not soft and (width := _edge_width(self.comparison)) > _SOFT_EDGE:
            size = "--sun gives it one" if self.view.light.kind == "directional" else "a radius in a scene file does"
            lines.append(
                f"the mask's edges are soft, some {width:.2g} px wide, but the light of {self.view.scene.name} has no "
                f"size and its true shadows are hard: {size}"
            )
        return lines


def accuracy_of(external: ExternalMask, view: View) -> Accuracy:
    """Score a mask against the truth of a view.

    The mask is scored unchanged: a shift, an sRGB encoding, an umbra that is not 0 or clipping is a warning and a field
    of `record["input"]`. Raises InputError for a mask that is flipped, rotated or inverted, and for screenshots without
    a pixel bright enough to score.
    """
    truth = cached_truth(view)
    unmeasured = 0
    if external.measurable is not None:
        unmeasured = int(np.count_nonzero(truth.receivers & ~truth.undecided & ~external.measurable))
        truth = replace(truth, receivers=truth.receivers & external.measurable)
    prepared = prepare_truth(truth)
    if unmeasured and not prepared.pixels:
        raise InputError(
            f"{external.name}: lit − ambient is below 1/64 in every pixel; allowed: a lit picture of the view"
        )
    if fault := misorientation(external.visibility, prepared):
        raise InputError(
            f"{external.name}: is {fault}, against the truth of {view.scene.name}; "
            "allowed: row 0 at the top, column 0 at the left, full = lit, 0 = in shadow"
        )
    comparison = Comparison(external.visibility, prepared)
    # Screenshots were decoded from sRGB already.
    encoding = detect_encoding(comparison) if external.measurable is None else MaskEncoding(estimate_shift(comparison))
    clipped = 0 if external.clipped is None else int(np.count_nonzero(external.clipped & prepared.valid))
    warnings = []
    if encoding.shift is not None:
        warnings.append(f"seems shifted by {shift_text(encoding.shift)}; scored as it is")
    if encoding.umbra is not None:
        warnings.append(f"its shadow is {encoding.umbra:.2f}, not 0; scored as it is")
    if encoding.srgb_encoded:
        warnings.append("seems to be sRGB-encoded (its soft values are too light for a linear mask); scored as it is")
    if (line := _uniform(comparison)) is not None:
        warnings.append(line)
    if seems_unrelated(comparison):
        warnings.append("has little in common with the truth; is it a mask of this scene, view and light?")
    if clipped > _NOTED_CLIPPED * prepared.pixels:
        share = clipped / prepared.pixels
        warnings.append(f"the lit picture is at full in {share:.1%} of the scored pixels and may be cut off there")
    input_record = {
        "source": "mask" if external.measurable is None else "screenshots",
        "shift_px": encoding.shift,
        "srgb_encoded": encoding.srgb_encoded,
        "umbra": encoding.umbra,
        "unmeasured": unmeasured,
        "clipped": clipped,
        "warnings": warnings,
    }
    record = {**mask_record(external.visibility, truth, prepared), "input": input_record}
    return Accuracy(external, view, comparison, record, tuple(f"{external.name}: {line}" for line in warnings))


def _uniform(comparison: Comparison) -> str | None:
    """A warning for a truth, else a mask, that is lit or in shadow in every scored pixel."""
    truth, pixels = comparison.truth, comparison.truth.pixels
    of_truth = [] if truth.soft else [("in this view the truth", truth.shadow)]
    for whose, shadow in (*of_truth, ("the mask", comparison.shadow)):
        count = int(np.count_nonzero(shadow))
        if pixels and count in (0, pixels):
            return f"{whose} is {'in shadow' if count else 'lit'} in every scored pixel, so most metrics say little"
    return None


def _edge_width(comparison: Comparison) -> float:
    """Grey pixels of a mask per pixel of the true edge; 0 without one."""
    truth, mask = comparison.truth, comparison.visibility
    edges = np.count_nonzero(truth.edge)
    return float(np.count_nonzero(truth.valid & (mask > _GREY[0]) & (mask < _GREY[1])) / edges) if edges else 0.0


def _eight_bit(comparison: Comparison) -> bool:
    """Whether the mask has grey pixels, all of them at levels of 8 bits."""
    levels = np.rint(comparison.visibility[comparison.truth.valid] * LEVELS)
    grey = (levels > 0) & (levels < LEVELS)
    return bool(grey.any()) and not (levels % (LEVELS // 255)).any()


def seems_unrelated(comparison: Comparison) -> bool:
    """Whether the shadows of mask and truth, neither empty, hardly overlap."""
    mask, truth = comparison.shadow, comparison.truth.shadow
    common, smaller = np.count_nonzero(mask & truth), min(np.count_nonzero(mask), np.count_nonzero(truth))
    return bool(common < _COMMON * smaller and common < _ALIKE_IOU * np.count_nonzero(mask | truth))
