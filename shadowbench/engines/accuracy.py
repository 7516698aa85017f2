"""Scoring a mask of another renderer against the truth of its view, with checks for common mistakes."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from shadowbench.engines.detection import (
    MaskEncoding,
    detect_encoding,
    misorientation,
    screenshot_encoding,
    shift_image,
    shift_text,
)
from shadowbench.engines.error_kinds import (
    ErrorKind,
    edge_widths,
    error_kinds,
    faint_kinds,
    soft_error_kinds,
    wrong_pixels,
)
from shadowbench.engines.external_mask import ExternalMask, decode_srgb
from shadowbench.engines.stored_truth import TruthOfView
from shadowbench.errors import InputError
from shadowbench.measure.scoring import mask_record
from shadowbench.scenes.model import View, view_digest
from shadowbench.scores.comparison import PENUMBRA, Comparison, share
from shadowbench.scores.difference import difference_picture
from shadowbench.scores.masks import LEVELS
from shadowbench.scores.metrics import METRICS, values_of
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth

_ROUNDING = 1 / (255 * math.sqrt(12))  # root mean square, of 8 bits
_RMSE = ("rmse", "rmse_pen")
_NOTED_CLIPPED = 0.01  # share of clipped pixels among the scored ones above which a warning is given
_SOFT_EDGE = 4.0  # width in pixels above which a mask's edges are softer than antialiasing or a small filter makes them
_ALIKE_IOU, _COMMON = 0.2, 0.5
"""IoU, and common share of the smaller shadow, below which a mask may be of another scene. At 256², three in four masks
of other built-in scenes are below, and none of the built-in techniques', even without bias."""
_MISSING, _AREA, _MOST = 0.1, 0.002, 0.15
"""Of shadows that lie elsewhere: the least share of the true interior that is lit; the least area of false shadow, as a
share of the picture; the most false shadow in such areas, as a share of the scored pixels, as acne covers more. In 21
built-in scenes at 256², at poor settings, only maps of up to 48 texels are like that, and in streets of 128."""


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Scores of a mask of another renderer; record: fields of its score record; comparison: mask and truth.

    truth: of the view, whose digest is that of its contents; encoding: what seems wrong with the whole mask.
    """

    external: ExternalMask
    view: View
    truth: Truth
    digest: str
    comparison: Comparison
    record: dict[str, Any]
    warnings: tuple[str, ...]
    encoding: MaskEncoding

    @property
    def metrics(self) -> dict[str, float | None]:
        """All metrics by name; None if a denominator is 0."""
        found: dict[str, float | None] = self.record["metrics"]
        return found

    @cached_property
    def kinds(self) -> list[ErrorKind]:
        """Kinds of error: of hard shadows, see `error_kinds`; of soft ones, causes before symptoms.

        What is wrong with the whole mask comes first; the others are those that are left once that is undone. Faintly
        dark pixels, which are not counted as wrong, come last.
        """
        causes, undone = self._causes
        metrics = values_of(undone) if causes else self.metrics
        if undone.truth.soft:
            kinds = soft_error_kinds(undone, metrics, self.encoding)
        else:
            kinds = [*error_kinds(undone, metrics), *faint_kinds(undone)]
        if undone is not self.comparison:
            kinds = [replace(kind, line=f"{kind.line}, once that is undone") for kind in kinds]
        return [*causes, *kinds]

    @cached_property
    def _causes(self) -> tuple[list[ErrorKind], Comparison]:
        """What is wrong with the whole mask, and the comparison without it.

        Of soft shadows a raised umbra only: `soft_error_kinds` tells the share of the error that others explain.
        """
        truth, encoding, visibility = self.comparison.truth, self.encoding, self.comparison.visibility
        causes = []
        if encoding.umbra is not None:
            pixels = int(np.count_nonzero(truth.shadow_interior))
            causes.append(ErrorKind("raised shadow", pixels, _raised_text(encoding, self.external)))
            visibility = encoding.lowered(visibility)
        if not truth.soft and encoding.srgb_encoded:
            soft = truth.valid & (visibility > PENUMBRA[0]) & (visibility < PENUMBRA[1])
            line = "soft values are too light for a linear mask"
            causes.append(ErrorKind("sRGB encoding", int(np.count_nonzero(soft)), line))
            visibility = decode_srgb(visibility).astype(np.float32)
        if not truth.soft and encoding.shift:
            across, down = encoding.shift
            causes.append(ErrorKind("shift", truth.pixels, f"by {shift_text(encoding.shift)}"))
            visibility = np.clip(shift_image(visibility, (-across, -down)), 0, 1)
        changed = visibility is not self.comparison.visibility
        return causes, Comparison(visibility, truth) if changed else self.comparison

    @cached_property
    def wrong(self) -> tuple[int, int]:
        """Numbers of pixels of false shadow and of false light."""
        false_shadow, false_light = map(np.count_nonzero, wrong_pixels(self.comparison))
        return int(false_shadow), int(false_light)

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
        soft, light = self.comparison.truth.soft, self.view.light
        if soft:
            error, inside = (METRICS[name].text(self.metrics[name], "{:.2g}".format, self.record) for name in _RMSE)
            told = f"RMSE {error}, in the penumbra {inside}"
        else:
            told = "{} of false shadow, {} of false light".format(*self.wrong)
        lines = [f"{self.comparison.truth.pixels} pixels scored: {told}"]
        if unmeasured := self.record["input"]["unmeasured"]:
            lines.append(f"{unmeasured} more not scored: lit and ambient picture differ there by less than 1/64")
        lines += [f"{kind.name}, {kind.pixels} px: {kind.line}" for kind in self.kinds]
        if soft:
            error, inside, share = (self.record[name] for name in ("truth_error", "truth_error_pen", "width_share"))
            own = f"the truth's own error is {inside:.2g} there, {error:.2g} over all pixels"
            lines.append(f"penumbra, {self.record['penumbra']} px: {own}")
            if share is not None:
                lines.append(f"widths of penumbrae are compared at {share:.0%} of the true edge")
            if _eight_bit(self.comparison):
                lines.append(f"the mask has 8 bits: rounding makes an RMSE of {_ROUNDING:.2g} in the penumbra")
        elif (width := sum(edge_widths(self._causes[1]))) > _SOFT_EDGE:
            size = "--sun gives it one" if light.kind == "directional" else "a radius in a scene file does"
            lines.append(
                f"the mask's edges are soft, some {width:.2g} px wide, but the light of {self.view.scene.name} has no "
                f"size and its true shadows are hard: {size}"
            )
        return lines


def accuracy_of(external: ExternalMask, against: View | TruthOfView) -> Accuracy:
    """Score a mask against the truth of a view, traced here or read from a file.

    The mask is scored unchanged: a shift, an sRGB encoding, an umbra that is not 0 or clipping is a warning and a field
    of `record["input"]`. Raises InputError for a mask that is flipped, rotated or inverted, and for screenshots without
    a pixel bright enough to score.
    """
    if isinstance(against, View):
        against = TruthOfView(cached_truth(against), against, view_digest(against))
    view, truth, unmeasured = against.view, against.truth, 0
    if view.size != external.size:
        raise InputError(
            f"{external.name}: found {external.size} × {external.size} pixels; allowed: {view.size} × {view.size}, "
            "as the truth has"
        )
    if external.measurable is not None:
        unmeasured = int(np.count_nonzero(truth.receivers & ~truth.undecided & ~external.measurable))
        truth = replace(truth, receivers=truth.receivers & external.measurable, facet_shadow=None)
    prepared = against.prepared(truth)
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
    screenshots = external.measurable is not None
    encoding = screenshot_encoding(comparison) if screenshots else detect_encoding(comparison)
    clipped = 0 if external.clipped is None else int(np.count_nonzero(external.clipped & prepared.valid))
    warnings = list(_warnings(external, comparison, encoding, clipped / max(prepared.pixels, 1)))
    input_record = {
        "source": "screenshots" if screenshots else "mask",
        "shift_px": encoding.shift,
        "srgb_encoded": encoding.srgb_encoded,
        "umbra": encoding.umbra,
        "unmeasured": unmeasured,
        "clipped": clipped,
        "warnings": warnings,
    }
    record = {**mask_record(external.visibility, truth, prepared), "input": input_record}
    told = tuple(f"{external.name}: {line}" for line in warnings)
    return Accuracy(external, view, against.truth, against.digest, comparison, record, told, encoding)


def _warnings(external: ExternalMask, comparison: Comparison, encoding: MaskEncoding, clipped: float) -> Iterator[str]:
    """What is suspicious about a mask; clipped: share of the scored pixels at which the lit picture is at full."""
    if encoding.shift is not None:
        yield f"seems shifted by {shift_text(encoding.shift)}; scored as it is"
    if encoding.umbra is not None:
        missing = external.measurable is not None and not external.ambient
        advice = "; --ambient takes ambient light off" if missing else ""
        yield f"its shadow is {encoding.umbra:.2f}, not 0; scored as it is{advice}"
    if encoding.srgb_encoded:
        yield "seems to be sRGB-encoded (its soft values are too light for a linear mask); scored as it is"
    if (line := _uniform(comparison)) is not None:
        yield f"{line} in every scored pixel, so most metrics say little"
    if seems_unrelated(comparison):
        yield "has little in common with the truth; is it a mask of this scene, view and light?"
    elif shadows_elsewhere(comparison):
        yield "shadows are missing and lie elsewhere, in large areas: another light or view, or a very coarse map?"
    if clipped > _NOTED_CLIPPED:
        yield f"the lit picture is at full in {clipped:.1%} of the scored pixels and may be cut off there"


def _uniform(comparison: Comparison) -> str | None:
    """How a truth, else a mask, is that is lit or in shadow everywhere; None if neither is."""
    truth, mask = comparison.truth, comparison.visibility[comparison.truth.valid]
    sides = {0: "lit", truth.pixels: "in shadow"} if truth.pixels else {}
    side = sides.get(int(np.count_nonzero(truth.shadow)))
    if side and not truth.soft:
        return f"in this view the truth is {side}"
    side = sides.get(int(np.count_nonzero(comparison.shadow)))
    if side and ((mask > 0) & (mask < 1)).any():
        bound = "½ or more, which counts as lit," if side == "lit" else "below ½, which counts as shadow,"
        return f"the mask's visibility is {bound}"
    return f"the mask is {side}" if side else None


def _raised_text(encoding: MaskEncoding, external: ExternalMask) -> str:
    """What raises an umbra."""
    told = f"the true shadow's interior has a visibility of {encoding.umbra:.2f} (median), not 0"
    if external.measurable is None:
        return told
    if external.ambient:
        return f"{told}, with --ambient taken off: light that it does not have"
    if encoding.floor is None:
        return f"{told}; if the pictures have ambient light, give it with --ambient"
    return f"{told}, as ambient light in both pictures leaves it: give it with --ambient"


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


def shadows_elsewhere(comparison: Comparison) -> bool:
    """Whether shadow is missing while false shadow lies in large areas; acne is scattered, or covers most of the light.

    The share of the shadow's interior that is missing and that of false shadow in large areas are 1 or more together.
    """
    truth = comparison.truth
    missing = share(comparison.lit, truth.shadow_interior) or 0.0
    if missing < _MISSING:
        return False
    false_shadow = comparison.shadow & truth.lit_interior
    sizes = np.bincount(ndimage.label(false_shadow)[0].ravel())[1:]
    large = int(sizes[sizes >= _AREA * false_shadow.size].sum())
    return 0 < large <= _MOST * truth.pixels and missing + large / int(sizes.sum()) >= 1
