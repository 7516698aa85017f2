"""A mask of another renderer, scored against the truth of its view, with checks for common mistakes; its row."""

import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.registration import phase_cross_correlation

from shadowbench.errors import InputError
from shadowbench.files import replace_file
from shadowbench.masks.inputs import PICTURE, ExternalMask, decode_srgb, external_mask
from shadowbench.measure.frames import CellScores, Truths, measured
from shadowbench.measure.pictures import Pictures, Rendering
from shadowbench.measure.rows import IMAGES, STILL, RowStore, identity
from shadowbench.measure.scoring import mask_record, prepare_truth
from shadowbench.options import ViewSize
from shadowbench.scenes.model import View, view_digest
from shadowbench.scores.comparison import PENUMBRA, Comparison, PreparedTruth
from shadowbench.scores.difference import difference_picture, write_difference
from shadowbench.scores.masks import write_mask
from shadowbench.scores.metrics import METRICS, leading_error, soft_faults
from shadowbench.truths.cache import cached_truth
from shadowbench.truths.trace import Truth
from shadowbench.versions import of_scores

if TYPE_CHECKING:
    from shadowbench.masks.export import Clip

_HARD_ERRORS = {
    "edge_px": (1, "edges lie {:.3g} px from the true ones on average"),
    "acne": (100, "{:.3g}% of the lit interior is dark"),
    "leak": (100, "{:.3g}% of the shadow's interior is lit"),
    "contact": (100, "{:.3g}% of the shadow next to its caster is lit (peter-panning)"),
}
"""By metric: the factor of its value, and the line that says it."""
_IDENTITY = ("scene", "view", "light", "spec", "view_size", "view_width", "renderer", *STILL)
_NAME = re.compile(r"[A-Za-z0-9][\w.+-]{0,79}")

Image = NDArray[np.float32]
Mask = NDArray[np.bool_]
Shift = tuple[float, float]

_TURNS = {
    "flipped vertically": (slice(None, None, -1), slice(None)),
    "flipped horizontally": (slice(None), slice(None, None, -1)),
    "rotated by 180°": (slice(None, None, -1), slice(None, None, -1)),
}
_SIDEWAYS: dict[str, Callable[[Image], Image]] = {
    "transposed": np.transpose,
    "rotated by 90° to the right": np.rot90,
    "rotated by 90° to the left": partial(np.rot90, k=-1),
}
_CORRELATED = 0.5  # least absolute correlation with the truth for a mask to be reported as flipped or inverted

_STEPS = 100  # steps of a pixel in which a shift is found
_FEWEST_AT_EDGES = 64  # edge pixels needed to estimate a shift
_FARTHEST = 8.0  # largest shift in pixels; a mask that seems shifted farther shows something else
_SMALLEST = 0.2  # smallest shift in pixels; a filter alone may seem to shift a mask by less
_UNDONE = 0.5  # largest share of the squared misfit left after undoing the shift; a bias leaves more
_ALIKE = 0.8  # least correlation at edges after undoing the shift

_FEWEST = 100  # pixels needed for a decision: a hard mask is the same in both encodings
_BLURS = (0.0, 0.7, 1.4, 2.8, 5.6)
"""Standard deviations in pixels: a mask may be smoother than the truth by an unknown amount."""
_CLEAR = 0.75
"""Largest misfit of a decoded mask, relative to that of the mask as it is, to be reported as encoded. Over the built-in
scenes at 256², decoding left 1.13 and more of a linear mask's, 0.41 and less of an encoded one's."""
_RAISED = (0.05, 0.95)  # visibility in the umbra that is neither a shadow of 0 nor a missing shadow
_DARKEST = 5  # percentile of the umbra that must be raised to speak of ambient light
_DEEP = 12  # px from the true edge, which soft edges do not reach


@dataclass(frozen=True)
class MaskEncoding:
    """Faults of a whole mask that is scored as it is.

    shift: columns to the right and rows down, None for no shift; srgb_encoded: None if too few pixels are soft to
    decide; umbra: visibility of the mask's umbra if that is not 0.
    """

    shift: Shift | None
    srgb_encoded: bool | None = None
    umbra: float | None = None


def misorientation(
    visibility: Image, prepared: PreparedTruth, sideways: Callable[[], PreparedTruth] | None = None
) -> str | None:
    """How the mask is turned, flipped or inverted, such as "flipped vertically"; None if it is not.

    sideways: the truth of a view with height and width exchanged, for which a mask unlike `prepared` may be meant.

    A mask is flipped if undoing that at least halves the gap of its correlation (Pearson 1895) with the truth to 1, and
    raises the correlation above ½; it is inverted if the best correlation is below −½. Constant masks and truths, and
    symmetries of the image, cannot be decided.
    """

    def correlation(mask: Image, truth: PreparedTruth) -> float:
        return _correlation(mask[truth.valid], truth.visibility[truth.valid])

    given = correlation(visibility, prepared)
    correlations = {turn: correlation(visibility[slices], prepared) for turn, slices in _TURNS.items()}
    if sideways is not None and abs(given) <= _CORRELATED:
        truth = sideways()
        correlations |= {turn: correlation(undo(visibility), truth) for turn, undo in _SIDEWAYS.items()}
    turn = max(correlations, key=lambda name: abs(correlations[name]))
    best = correlations[turn]
    turned = abs(best) > _CORRELATED and 1 - abs(best) < (1 - abs(given)) / 2
    inverted = (best if turned else given) < -_CORRELATED
    faults = ([turn] if turned else []) + (["inverted"] if inverted else [])
    return " and ".join(faults) or None


def detect_encoding(comparison: Comparison, linear: bool = False) -> MaskEncoding:
    """What is wrong with a whole mask; linear: it is known to be linear, as that of screenshots.

    A mask is sRGB-encoded if decoding makes its soft pixels fit the truth's `area` clearly better, each with its shift
    undone and at the best blur.
    """
    truth, given = comparison.truth, comparison.visibility
    umbra = _raised_umbra(comparison)
    lowered = given if umbra is None else _lowered(given, umbra)
    as_given = Comparison(lowered, truth)
    shift = estimate_shift(as_given)
    soft = _soft(comparison)
    if linear or np.count_nonzero(soft) < _FEWEST:
        return MaskEncoding(shift, None, umbra)
    decoded = Comparison(decode_srgb(lowered).astype(np.float32), truth)
    shift_decoded = estimate_shift(decoded)
    if _misfit(decoded, soft, shift_decoded) < _CLEAR * _misfit(as_given, soft, shift):
        return MaskEncoding(shift_decoded, True, umbra)
    return MaskEncoding(shift, False, umbra)


def _raised_umbra(comparison: Comparison) -> float | None:
    """Median visibility of the umbra, if it is raised all over, as ambient light does it; else None."""
    truth, inside = comparison.truth, comparison.truth.shadow_interior
    deep = inside & (truth.squared_edge_distance >= _DEEP**2)
    inside = deep if np.count_nonzero(deep) >= _FEWEST else inside
    if np.count_nonzero(inside) < _FEWEST:
        return None
    visibility = comparison.visibility[inside]
    umbra = round(float(np.median(visibility)), 3)
    if not _RAISED[0] < umbra < _RAISED[1] or np.percentile(visibility, _DARKEST) < umbra / 4:
        return None
    # A wide filter alone lightens a narrow umbra too, but not evenly, nor is the rest like the truth without that.
    if float(np.abs(visibility - umbra).mean()) > _misfit(comparison, inside, None):
        return None
    lowered = Comparison(_lowered(comparison.visibility, umbra), truth)
    soft = _soft(comparison)
    return umbra if _misfit(lowered, soft, None) < _misfit(comparison, soft, None) else None


def _lowered(visibility: Image, umbra: float) -> Image:
    """The visibility that would have been without ambient light that raises the umbra."""
    return np.asarray(np.clip((visibility - umbra) / (1 - umbra), 0, 1), np.float32)


def _soft(comparison: Comparison) -> Mask:
    """Valid pixels of a mask that are neither lit nor in shadow."""
    soft: Mask = comparison.truth.valid & (comparison.visibility > PENUMBRA[0]) & (comparison.visibility < PENUMBRA[1])
    return soft


def estimate_shift(comparison: Comparison) -> Shift | None:
    """Shift of the whole mask against the truth, in columns to the right and rows down; None for no shift.

    The peak of the correlation of the gradients of the mask and of the truth's `area`, as complex numbers, refined by
    the upsampled DFT of Guizar-Sicairos et al. (2008). A shift is reported only if undoing it removes at least half of
    the squared misfit and makes the mask much like the truth; a bias, by contrast, displaces each shadow differently.
    """
    valid, weight = comparison.truth.valid, comparison.truth.valid.astype(np.float32)
    images = comparison.visibility, comparison.truth.area
    inside = ndimage.gaussian_filter(_inside(valid, 3).astype(np.float32), 2.0)
    gradients = [_gradient(image) * inside for image in images]
    if not all(map(np.any, gradients)):
        return None
    (down, across), *_ = phase_cross_correlation(*gradients, upsample_factor=_STEPS, normalization=None)
    if not _SMALLEST <= max(abs(across), abs(down)) <= _FARTHEST:
        return None
    shift = round(float(across), 3), round(float(down), 3)
    mask, truth = (smooth(image, weight, 1.0) for image in images)
    there = shift_image(truth, shift)
    edges = _inside(valid, max(map(abs, shift)) + 2) & (np.abs(_gradient(there)) > 0.05)
    if np.count_nonzero(edges) < _FEWEST_AT_EDGES:
        return None
    left, before = (np.square(mask - image).sum(where=edges, dtype=np.float64) for image in (there, truth))
    return shift if left <= _UNDONE * before and _correlation(mask[edges], there[edges]) >= _ALIKE else None


def shift_text(shift: Shift) -> str:
    """A shift in words."""
    across, down = shift
    parts = [(across, "to the right", "to the left"), (down, "down", "up")]
    return " and ".join(
        f"{abs(value):.2f} px {forth if value > 0 else back}" for value, forth, back in parts if abs(value) >= 0.05
    )


def smooth(values: Image, weight: Image, sigma: float) -> Image:
    """Weighted Gaussian mean of (H, W) values; 0 where the weights vanish nearby. sigma in pixels."""
    total = ndimage.gaussian_filter(weight, sigma, mode="nearest")
    mean = ndimage.gaussian_filter(values * weight, sigma, mode="nearest")
    smoothed: Image = np.divide(mean, total, out=np.zeros_like(mean), where=total > 1e-3)
    return smoothed


def shift_image(image: Image, shift: Shift) -> Image:
    """Image shifted by columns to the right and rows down, in pixels, with cubic splines."""
    across, down = shift
    result: Image = ndimage.shift(image, (down, across), order=3, mode="nearest")
    return result


def _correlation(mask: Image, truth: Image) -> float:
    """Pearson correlation of (N,) values; 0 if either is constant, or nearly so."""
    if not mask.size or min(np.ptp(mask), np.ptp(truth)) < 1e-3:
        return 0.0
    return float(np.corrcoef(mask, truth)[0, 1])


def _gradient(image: Image) -> NDArray[np.complex64]:
    """Derivatives along columns, and along rows as the imaginary part; 0 of a single pixel."""
    if min(image.shape) < 2:
        return np.zeros(image.shape, np.complex64)
    down, across = np.gradient(image)
    return np.asarray(across + 1j * down, np.complex64)


def _inside(valid: Mask, margin: float) -> Mask:
    """Pixels whose neighbourhood is valid too, so that the shift brings in no invalid pixels."""
    size = 2 * int(np.ceil(margin)) + 1
    inside: Mask = ndimage.minimum_filter(valid, size, mode="constant", cval=1)
    return inside


def _misfit(comparison: Comparison, where: Mask, shift: Shift | None) -> float:
    """Mean absolute difference of a mask from the truth's `area`, shifted and at the best blur."""
    area, weight = comparison.truth.area, comparison.truth.valid.astype(np.float32)
    truth = area if shift is None else shift_image(area, shift)
    blurred = (smooth(truth, weight, blur) if blur else truth for blur in _BLURS)
    return min(float(np.abs(comparison.visibility - image).mean(where=where, dtype=np.float64)) for image in blurred)


@dataclass(frozen=True, eq=False)
class Accuracy:
    """Scores of a mask of another renderer; record: fields of its score record; comparison: mask and truth.

    Of a sequence metrics are of all frames, `film` has pictures of them, and all else is of the first.
    """

    external: ExternalMask
    view: View
    truth: Truth
    comparison: Comparison
    record: dict[str, Any]
    film: Sequence[NDArray[np.uint8]] = ()

    @property
    def metrics(self) -> dict[str, float | None]:
        """All metrics by name; None if a denominator is 0."""
        metrics: dict[str, float | None] = self.record["metrics"]
        return metrics

    @property
    def warnings(self) -> list[str]:
        """A line for each fault of the whole mask."""
        return [f"{self.external.name}: {line}" for line in self.record["input"]["warnings"]]

    @property
    def errors(self) -> dict[str, str]:
        """A line for each metric, or fault of a soft shadow, that says what is wrong, the leading one first."""
        if self.comparison.truth.soft:
            return soft_faults(self.metrics, self.comparison.width_bias)
        leading = leading_error(self.metrics)
        lines = {
            name: line.format(factor * value)
            for name, (factor, line) in _HARD_ERRORS.items()
            if (value := self.metrics[name])
        }
        return dict(sorted(lines.items(), key=lambda item: item[0] != leading))

    @property
    def wrong(self) -> tuple[int, int]:
        """Numbers of pixels of false shadow and of false light, on the other side of ½ than the truth."""
        mask, truth = self.comparison, self.comparison.truth
        return int(np.count_nonzero(mask.shadow & truth.lit)), int(np.count_nonzero(mask.lit & truth.shadow))

    def values(self) -> dict[str, Any]:
        """JSON object of `score --json`."""
        return {
            "scene": self.view.scene.name,
            "view": self.view.camera.name,
            "light": self.view.light.name,
            **self.view.size.columns,
            **self.record,
            **dict(zip(("false_shadow", "false_light"), self.wrong, strict=True)),
            "errors": self.errors,
            "warnings": self.warnings,
        }

    def summary(self) -> list[str]:
        """Lines of text about the errors."""
        of, truth = "first frame: " if self.film else "", self.comparison.truth
        if truth.soft:
            error, inside = (
                METRICS[name].text(self.metrics[name], "{:.2g}".format, self.record) for name in ("rmse", "rmse_pen")
            )
            lines = [f"{of}{truth.pixels} pixels scored: RMSE {error}, in the penumbra {inside}"]
        else:
            false_shadow, false_light = self.wrong
            lines = [f"{of}{truth.pixels} pixels scored: {false_shadow} of false shadow, {false_light} of false light"]
        if unmeasured := self.record["input"]["unmeasured"]:
            lines.append(f"{unmeasured} more not scored: lit and ambient picture differ there by less than 1/64")
        lines += [f"{name}: {line}" for name, line in self.errors.items()]
        if truth.soft:
            error, inside = self.record["truth_error"], self.record["truth_error_pen"]
            own = f"the truth's own error is {inside:.2g} there, {error:.2g} over all pixels"
            lines.append(f"penumbra, {self.record['penumbra']} px: {own}")
            if (share := self.record["width_share"]) is not None:
                lines.append(f"widths of penumbrae are compared at {share:.0%} of the true edge")
        return lines


def accuracy_of(external: ExternalMask, view: View) -> Accuracy:
    """Score a mask against the truth of a view.

    The mask is scored unchanged: a shift, an sRGB encoding or an umbra that is not 0 is a warning and a field of
    `record["input"]`. Raises InputError for a mask that is flipped or inverted, and screenshots without a pixel bright
    enough to score.
    """
    whole = cached_truth(view)
    truth = measured(whole, external.measurable)
    unmeasured = int(np.count_nonzero(whole.receivers & ~whole.undecided & ~truth.receivers))
    prepared = prepare_truth(truth)
    if unmeasured and not prepared.pixels:
        raise InputError(
            f"{external.name}: lit − ambient is below 1/64 in every pixel; allowed: a lit picture of the view"
        )
    _check_orientation(external, prepared, view)
    comparison = Comparison(external.visibility, prepared)
    screenshots = external.measurable is not None
    encoding = detect_encoding(comparison, linear=screenshots)
    input_record = {
        "source": "screenshots" if screenshots else "mask",
        "shift_px": encoding.shift,
        "srgb_encoded": encoding.srgb_encoded,
        "umbra": encoding.umbra,
        "unmeasured": unmeasured,
        "warnings": list(_warnings(encoding, screenshots)),
    }
    record = {**mask_record(external.visibility, truth, prepared), "input": input_record}
    return Accuracy(external, view, whole, comparison, record)


def _check_orientation(external: ExternalMask, prepared: PreparedTruth, view: View) -> None:
    """Raises InputError for a mask that is flipped, turned or inverted."""
    turned = replace(view, size=ViewSize(*view.size.shape))
    if fault := misorientation(external.visibility, prepared, lambda: prepare_truth(cached_truth(turned))):
        raise InputError(
            f"{external.name}: is {fault}, against the truth of {view.scene.name}; "
            "allowed: row 0 at the top, column 0 at the left, full = lit, 0 = in shadow"
        )


def accuracy_of_clip(clip: "Clip", folders: Sequence[Path | None], linear: bool, step: Callable[..., None]) -> Accuracy:
    """Score pictures of a sequence's frames in folders, as those of `external_mask`; `step` is called with each name.

    Raises InputError for one that is missing or of another size, and as `accuracy_of`, whose warnings are of the first.
    """
    nothing, size = np.zeros((0, 0, 3), np.uint8), clip.frames[0].size
    with closing(Truths(clip.frames)) as truths:
        scores = CellScores(truths, filmed=True)
        for index in range(len(clip.frames)):
            file, lit, shadowed, ambient = (folder and folder / PICTURE.format(index) for folder in folders)
            mask = external_mask(file, lit, shadowed, ambient, linear)
            if mask.size != size:
                raise InputError(f"{mask.name}: found {mask.size} pixels; allowed: {size}, as was exported")
            if index == 0:
                first = accuracy_of(mask, clip.frames[0])
            _check_orientation(mask, prepare_truth(measured(truths[index].truth, mask.measurable)), clip.frames[index])
            scores.add(Rendering(mask.visibility, nothing, None, None, {}, {}, measurable=mask.measurable), None)
            step(mask.name)
    record = {**first.record, **scores.record(), "sequence": clip.name, "frames": len(clip.frames)}
    return replace(first, record=record, film=scores.film)


def _warnings(encoding: MaskEncoding, screenshots: bool) -> Iterator[str]:
    """What is wrong with a whole mask, in words."""
    if encoding.shift is not None:
        yield f"seems shifted by {shift_text(encoding.shift)}; scored as it is"
    if encoding.umbra is not None:
        advice = "; --ambient takes ambient light off" if screenshots else ""
        yield f"its shadow is {encoding.umbra:.2f}, not 0; scored as it is{advice}"
    if encoding.srgb_encoded:
        yield "seems to be sRGB-encoded (its soft values are too light for a linear mask); scored as it is"


def check_name(name: str) -> None:
    """Raises InputError unless the name can be used in a spec, a column and a file name."""
    if not _NAME.fullmatch(name):
        raise InputError(f"--name: found {name!r}; allowed: letters, digits and . _ + -, at most 80 of them")


def append_row(accuracy: Accuracy, name: str, folder: Path) -> bool:
    """Write an engine's score row, mask, difference and truth into a run folder; False if its newest row is the same.

    The row's technique and spec are the engine's name, its renderer is `external: NAME`. A changed mask gets a new row
    after the older one. Raises InputError if the folder cannot be written or another run writes into it.
    """
    view = accuracy.view
    cell, renderer = identity(view, technique=name, spec=name, full_spec=name), f"external: {name}"
    cell |= {part: accuracy.record.get(part, value) for part, value in STILL.items()}
    content = _digest(  # of everything that the row depends on
        {
            "engine": name,
            "view": (view.scene.name, view.camera.name, view.light.name, view_digest(view)),
            "mask": accuracy.record["mask_sha256"],
            **{part: accuracy.record[part] for part in (*STILL, "by_frame") if part in accuracy.record},
            "input": accuracy.record["input"],
            "versions": of_scores(),
        }
    )
    with closing(RowStore(folder)) as store:
        named = {**cell, "renderer": renderer}
        same = [row for row in store.scores.values() if all(row.get(part) == named[part] for part in _IDENTITY)]
        if same and same[-1].get("content") == content:
            return False
        # A mask that was changed back gets a new row too, since the newest row of a cell counts.
        key = content if content not in store.scores else _digest([content, same[-1]["key"]])
        for kind in IMAGES:
            (folder / kind).mkdir(exist_ok=True)
        write_mask(folder / "masks" / f"{key}.png", accuracy.external.visibility)
        write_difference(folder / "differences" / f"{key}.png", difference_picture(accuracy.comparison))
        pictures = Pictures(folder)
        pictures.write_film(key, accuracy.film)
        pictures.write_truth(view, accuracy.truth)
        if accuracy.external.picture is not None:
            with replace_file(folder / "pictures" / f"{key}.png") as temporary:
                shutil.copyfile(accuracy.external.picture, temporary)
        row = {"kind": "score", "key": key, **cell, "content": content, "renderer": renderer, "status": "ok"}
        row |= {**accuracy.record, "gpu_bytes": None, "work": {}, "facts": {}, "assumptions": list(view.scene.notes)}
        store.append(row)
        return True


def _digest(parts: object) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:24]
