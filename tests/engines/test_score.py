"""`score` as a command: its output, errors, warnings, pictures and rows."""

import json
import os
import subprocess
import sys
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from shadowbench import api
from shadowbench.engines.accuracy import Accuracy, accuracy_of, shadows_elsewhere
from shadowbench.engines.detection import MaskEncoding
from shadowbench.engines.error_kinds import error_kinds, soft_error_kinds
from shadowbench.engines.external_mask import from_screenshots, mask_from_array
from shadowbench.errors import number
from shadowbench.scenes.model import View, view_of
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.comparison import Comparison, PreparedTruth
from shadowbench.scores.masks import read_mask, write_mask
from shadowbench.scores.metrics import METRICS, score
from shadowbench.truths.cache import cached_truth
from tests.engines.conftest import srgb

SCENE = "stairs"


@pytest.fixture
def mask(drawn: Callable, tmp_path: Path) -> Path:
    """A correct mask."""
    write_mask(tmp_path / "mask.png", drawn(SCENE))
    return tmp_path / "mask.png"


def rows_of(folder: Path) -> list[dict]:
    return [json.loads(line) for line in (folder / "rows.jsonl").read_text(encoding="utf-8").splitlines()]


def test_every_metric_is_printed_and_is_that_of_a_run(shadowbench: Callable, mask: Path, prepared: Callable) -> None:
    """Those of penumbrae where there is one."""
    answer = shadowbench("score", SCENE, mask)
    assert answer.code == 0
    of_penumbrae = {"rmse_pen", "bias_pen", "noise", "banding", "width", "hardening", "hardening_intercept"}
    printed = [name for name in METRICS if name not in of_penumbrae]
    assert [line.split()[0] for line in answer.out.splitlines()[2 : 2 + len(printed)]] == printed
    found = json.loads(shadowbench("score", SCENE, mask, "--json").out)
    assert found["metrics"] == score(read_mask(mask), prepared(SCENE))
    assert found["metrics"]["iou"] > 0.98 and found["warnings"] == []
    assert (found["view_size"], found["view"], found["light"]) == (256, "camera", "light")


SOFT = """
[camera]
position = [2.3, 4.0, 3.4]
target = [0.4, 0.2, -0.2]
fov_y = 50.0
[light]
kind = "directional"
direction = [0.8, -1.0, -0.4]
angular_radius = 6.0
[[mesh]]
shape = "plane"
scale = 8.0
[[mesh]]
shape = "box"
scale = [0.8, 1.6, 0.8]
translate = [-0.4, 0.8, 0.2]
"""


def test_a_mask_of_soft_shadows_is_scored_with_the_error_of_the_truth(
    shadowbench: Callable, png: Callable, tmp_path: Path
) -> None:
    scene, size = tmp_path / "soft.toml", 96
    scene.write_text(SOFT)
    truth = cached_truth(chosen_view(scene, size))
    shifted = np.roll(truth.visibility, 1, axis=1)
    files = tmp_path / "exact.png", tmp_path / "shifted.png"
    for file, visibility in zip(files, (truth.visibility, shifted), strict=True):
        write_mask(file, np.where(truth.receivers, visibility, 1))
    exact, other = (json.loads(shadowbench("score", scene, file, "--json").out) for file in files)
    own = {name: exact[name] for name in ("truth_error", "truth_error_pen", "penumbra", "width_share")}
    assert api.score(read_mask(files[0]), truth) == exact["metrics"] | own
    assert 0 < exact["truth_error"] < exact["truth_error_pen"] < 0.01 and exact["penumbra"] > 100
    assert exact["metrics"]["rmse"] == exact["metrics"]["width"] == 0
    assert other["metrics"]["rmse_pen"] > 10 * exact["truth_error_pen"]

    outs = [shadowbench("score", scene, file).out for file in (*files, png("coarse.png", shifted))]
    printed = [{words[0]: words[1] for line in out.splitlines() if (words := line.split())} for out in outs]
    assert printed[0]["rmse"] == f"<{number(exact['truth_error'])}"
    assert printed[0]["rmse_pen"] == printed[0]["noise"] == f"<{number(exact['truth_error_pen'])}"
    assert printed[1]["rmse_pen"] == number(other["metrics"]["rmse_pen"])
    assert "penumbra," in printed[0] and "width" in printed[0] and "iou" in printed[0]
    assert not {"contact", "acne", "leak", "edge_p95"} & printed[0].keys(), "made for hard edges"
    assert f"RMSE <{exact['truth_error']:.2g}, in the penumbra <" in outs[0]
    assert f"RMSE {other['metrics']['rmse']:.2g}, in the penumbra {other['metrics']['rmse_pen']:.2g}" in outs[1]
    rounding = "the mask has 8 bits: rounding makes an RMSE of 0.0011 in the penumbra"
    assert [rounding in out for out in outs[1:]] == [False, True]

    folder, wrong = tmp_path / "rows", tmp_path / "wrong.png"
    assert shadowbench("score", scene, files[1], "-o", folder, "--name", "mine", "--diff", wrong).code == 0
    with Image.open(wrong) as picture:
        assert picture.width == size < picture.height  # with a legend
    (row,) = rows_of(folder)
    assert (row["metrics"], row["width_share"]) == (other["metrics"], other["width_share"])


@pytest.mark.parametrize(
    ("blur", "sun", "hinted"), [(0.0, False, False), (0.7, False, False), (4.0, False, True), (4.0, True, False)]
)
def test_a_soft_mask_of_a_light_without_a_size_gets_a_hint(
    shadowbench: Callable, drawn: Callable, tmp_path: Path, blur: float, sun: bool, hinted: bool
) -> None:
    """Antialiasing is no softness."""
    write_mask(tmp_path / "mask.png", ndimage.gaussian_filter(drawn(SCENE), blur))
    out = shadowbench("score", SCENE, tmp_path / "mask.png", *(["--sun"] if sun else [])).out
    assert ("true shadows are hard: --sun gives it one" in out) == hinted


def test_errors_of_soft_shadows_are_told_in_terms_of_penumbra_umbra_and_full_light() -> None:
    """A straight penumbra, dark at the left, that widens from top to bottom of a floor of 16 m."""
    size = 160
    y, x = np.mgrid[:size, :size].astype(float)
    exact = np.clip((x - 80) / (6 + y / 4) + 0.5, 0, 1)
    everywhere, penumbra = np.ones((size, size), bool), (exact > 0) & (exact < 1)
    arrays = {
        "visibility": exact,
        "standard_error": np.zeros_like(exact),
        "receivers": everywhere,
        "undecided": ~everywhere,
        "area": exact,
        "blocker": np.where(exact < 1, 5.0, np.inf),
        "cosine": everywhere,
        "diagonal": 16.0,
    }
    truth = PreparedTruth(arrays, lambda: np.stack([x, 0 * x, y], axis=-1) / 10)
    checkered = np.where((x + y) % 2, 0.2, -0.2)
    masks = {
        "penumbra too narrow": exact > 0.5,
        "penumbra too wide": np.clip((x - 80) / (12 + y / 2) + 0.5, 0, 1),
        "contact hardening": np.clip((x - 80) / 26 + 0.5, 0, 1),
        "penumbra too light": exact**0.5,
        "penumbra too dark": exact**2,
        "light bleeding": np.maximum(exact, 0.3),
        "false shadow": np.minimum(exact, 0.7),
        "noise": np.where(penumbra, np.clip(exact + checkered, 0, 1), exact),
        "banding": np.rint(exact * 4) / 4,
    }
    opposites = ({"penumbra too narrow", "penumbra too wide"}, {"penumbra too light", "penumbra too dark"})

    def kinds(mask: np.ndarray, shift: tuple[float, float] | None = None, encoded: bool = False) -> list[str]:
        encoding = MaskEncoding(shift, encoded)
        return [kind.name for kind in soft_error_kinds(Comparison(mask, truth), score(mask, truth), encoding)]

    for kind, mask in masks.items():
        assert kind in kinds(mask)
        assert not any(both <= set(kinds(mask)) for both in opposites)
    assert kinds(exact) == []
    # Causes come first; a blur too narrow to widen penumbrae much is told too.
    assert kinds(ndimage.gaussian_filter(exact, 2.0)) == ["blur"]
    assert kinds(ndimage.gaussian_filter(exact, 8.0))[:2] == ["blur", "penumbra too wide"]
    assert kinds(ndimage.shift(exact, (0, 3), order=1, mode="nearest"), (3.0, 0.0)) == ["shift", "penumbra too dark"]
    assert kinds(srgb(exact), encoded=True) == ["sRGB encoding", "penumbra too light"]
    # The umbra is larger than the penumbra: of the same error, its sum of squares is larger.
    order = kinds(np.maximum(exact, 0.3))
    assert order.index("light bleeding") < order.index("penumbra too light")


@pytest.mark.parametrize(
    ("turn", "fault"),
    [
        (lambda mask: mask[::-1], "is flipped vertically,"),
        (lambda mask: mask[:, ::-1], "is flipped horizontally,"),
        (lambda mask: 1 - mask, "is inverted,"),
        (lambda mask: mask[:, :200], "found 200 × 256 pixels; allowed: a square"),
    ],
)
def test_rotated_inverted_or_non_square_masks_are_refused(
    shadowbench: Callable, drawn: Callable, tmp_path: Path, turn: Callable, fault: str
) -> None:
    write_mask(tmp_path / "bad.png", turn(drawn(SCENE)))
    answer = shadowbench("score", SCENE, tmp_path / "bad.png", "-o", tmp_path / "rows", "--name", "mine")
    assert (answer.code, answer.out) == (2, "")
    assert fault in answer.err and answer.err.count("\n") == 1
    assert not (tmp_path / "rows").exists()


def test_a_shift_and_an_encoding_are_warned_of_and_scored_as_they_are(
    shadowbench: Callable, drawn: Callable, tmp_path: Path, prepared: Callable
) -> None:
    file = tmp_path / "mask.png"
    for values, key, line in (
        (drawn(SCENE, shift=(0.5, -1)), "shift_px", "seems shifted by 0.50 px to the right and 1.00 px up; scored as"),
        (srgb(drawn(SCENE)), "srgb_encoded", "seems to be sRGB-encoded"),
        (0.3 + 0.7 * drawn(SCENE), "umbra", "its shadow is 0.30, not 0; scored as it is"),
    ):
        write_mask(file, values)
        answer = shadowbench("score", SCENE, file)
        assert answer.code == 0 and line in answer.err
        found = json.loads(shadowbench("score", SCENE, file, "--json").out)
        assert found["input"][key] and line in found["warnings"][0] and len(found["warnings"]) == 1
        assert found["metrics"] == score(read_mask(file), prepared(SCENE))


UNRELATED = "has little in common with the truth; is it a mask of this scene, view and light?"
ELSEWHERE = "shadows are missing and lie elsewhere, in large areas: another light or view, or a very coarse map?"
UNIFORM = "the mask is {} in every scored pixel, so most metrics say little"


@pytest.mark.parametrize(
    ("scene", "level", "warnings"),
    [
        ("spot-lamp", None, [UNRELATED]),
        (SCENE, None, []),
        (SCENE, 1.0, [UNIFORM.format("lit")]),
        (SCENE, 0.0, [UNIFORM.format("in shadow")]),
    ],
)
def test_a_mask_of_another_scene_or_of_one_value_is_warned_of(
    shadowbench: Callable, drawn: Callable, tmp_path: Path, scene: str, level: float | None, warnings: list[str]
) -> None:
    write_mask(tmp_path / "mask.png", drawn(scene) if level is None else np.full((256, 256), level))
    told = shadowbench("score", SCENE, tmp_path / "mask.png").err
    assert told == "".join(f"warning: {tmp_path / 'mask.png'}: {line}\n" for line in warnings)


def turned(view: View, degrees: float) -> View:
    """A view whose light is turned about the vertical through the camera's target."""
    camera, light, angle = view.camera, view.light, np.radians(degrees)
    about = np.array([[np.cos(angle), 0, np.sin(angle)], [0, 1, 0], [-np.sin(angle), 0, np.cos(angle)]])
    changes: dict[str, Any] = {}
    if light.direction is not None:
        changes["direction"] = about @ light.direction
    if light.position is not None:
        changes["position"] = camera.target + about @ np.subtract(light.position, camera.target)
    return view_of(view.scene, camera, replace(light, **changes), view.size)


@pytest.mark.parametrize(
    ("scene", "degrees", "size"),
    [
        (SCENE, 30, 256),
        (SCENE, 30, 512),
        ("cube-on-plane", 30, 256),
        ("colonnade", -45, 256),
        ("sphere-and-torus", 30, 256),
        ("spot-lamp", 15, 256),
        ("lamp-by-wall", 15, 256),
    ],
)
def test_exact_shadows_of_another_light_are_warned_of(scene: str, degrees: float, size: int, truth_cache: None) -> None:
    """Whatever the resolution; their IoU of .2 to .7 is one that a bias might have too."""
    view = chosen_view(scene, size)
    other = cached_truth(turned(view, degrees), 1)
    mask = np.where(other.receivers, other.visibility, 0)
    found = accuracy_of(mask_from_array(mask, "mask"), view)
    assert 0.2 < (found.metrics["iou"] or 0) < 0.7 and found.warnings == (f"mask: {ELSEWHERE}",)


@pytest.mark.parametrize("period", [2, 12, 48])
@pytest.mark.parametrize("missing", ["contact", "shadow"])
def test_acne_beside_missing_shadows_is_not_taken_for_those_of_another_light(
    comparison: Callable, prepared: Callable, missing: str, period: int
) -> None:
    truth = prepared(SCENE)
    stripes = np.add.outer(np.arange(256), np.arange(256)) % period < period / 2
    mask = np.where(getattr(truth, missing), 1, np.where(truth.lit & stripes, 0, truth.visibility))
    assert not shadows_elsewhere(comparison(mask, SCENE))


@pytest.mark.parametrize(("height", "side"), [(-1.0, "lit"), (1.0, "in shadow")])
def test_a_truth_of_one_value_is_warned_of(shadowbench: Callable, tmp_path: Path, height: float, side: str) -> None:
    scene, file = tmp_path / "floor.toml", tmp_path / "mask.png"
    scene.write_text(
        '[camera]\nposition = [0, 0.9, 0.1]\ntarget = [0, 0, 0]\n[light]\nkind = "directional"\n'
        'direction = [0, -1, 0]\n[[mesh]]\nshape = "plane"\n[[mesh]]\nshape = "plane"\nscale = 9\n'
        f"translate = [0, {height}, 0]\nreceives = false\n"
    )
    write_mask(file, np.full((64, 64), float(side == "lit")))
    warning = f"warning: {file}: in this view the truth is {side} in every scored pixel, so most metrics say little"
    assert warning in shadowbench("score", scene, file).err.splitlines()


def test_a_mask_of_another_size_than_the_export_beside_it_is_warned_of(
    shadowbench: Callable, drawn: Callable, tmp_path: Path
) -> None:
    assert shadowbench("export", SCENE, tmp_path, "--view-size", "256").code == 0
    file = tmp_path / "mask.png"
    for size, told in ((256, False), (128, True)):
        write_mask(file, drawn(SCENE, size))
        answer = shadowbench("score", SCENE, file)
        line = f"128², where {tmp_path / 'view.json'} says 256²; a mask's size is the view's: scored as the view of"
        assert (answer.code, line in answer.err) == (0, told)
        found = json.loads(shadowbench("score", SCENE, file, "--json").out)
        assert (found["view_size"], len(found["warnings"])) == (size, int(told))
    (tmp_path / "view.json").write_text("of another program", encoding="utf-8")
    assert shadowbench("score", SCENE, file).err == ""


def test_screenshots_give_the_scores_of_the_mask_behind_them(
    shadowbench: Callable, drawn: Callable, png: Callable, prepared: Callable
) -> None:
    visibility, light = drawn(SCENE), np.clip(prepared(SCENE).cosine, 0, 1) * 0.8
    ambient = np.full_like(light, 0.1)
    pictures = {"lit": ambient + light, "shadowed": ambient + light * visibility, "ambient": ambient}
    files = [part for name, values in pictures.items() for part in (f"--{name}", png(f"{name}.png", srgb(values)))]
    found = json.loads(shadowbench("score", SCENE, *files, "--json").out)
    exact = score(visibility, prepared(SCENE))
    assert found["metrics"]["iou"] == pytest.approx(exact["iou"], abs=2e-3)
    assert found["metrics"]["mae"] == pytest.approx(exact["mae"], abs=2e-3)
    weak = prepared(SCENE).valid & (light < 1 / 64 - 2e-3)
    assert weak.sum() <= found["input"]["unmeasured"] <= (prepared(SCENE).valid & (light < 1 / 64 + 2e-3)).sum()
    assert found["receivers"] + found["input"]["unmeasured"] >= prepared(SCENE).pixels
    assert found["input"]["source"] == "screenshots"


def test_linear_screenshots_give_the_scores_of_srgb_ones(
    shadowbench: Callable, drawn: Callable, png: Callable, prepared: Callable
) -> None:
    light = np.clip(prepared(SCENE).cosine, 0, 1) * 0.9
    pictures = {"lit": light, "shadowed": light * drawn(SCENE)}
    scores = []
    for encode, options in ((srgb, ()), (np.asarray, ("--linear",))):
        files = [
            part for name, values in pictures.items() for part in (f"--{name}", png(f"{name}.png", encode(values)))
        ]
        scores.append(json.loads(shadowbench("score", SCENE, *files, *options, "--json").out)["metrics"])
    assert scores[0]["iou"] > 0.95
    for name in ("iou", "mae", "ssim"):
        assert scores[1][name] == pytest.approx(scores[0][name], abs=2e-3)


@pytest.fixture
def pictured(prepared: Callable, png: Callable) -> Callable[..., Accuracy]:
    """The accuracy of screenshots of a visibility, with ambient light in both, given or not."""

    def shoot(visibility: np.ndarray, ambient: float = 0.0, given: bool = False, power: float = 0.0) -> Accuracy:
        light = np.clip(prepared(SCENE).cosine, 0, 1) * 0.5
        linear = {"lit": ambient + light, "shadowed": ambient + light * visibility, "ambient": 0 * light + ambient}
        encoded = {name: values**power if power else srgb(values) for name, values in linear.items()}
        files = [png(f"{name}.png", values) for name, values in encoded.items()]
        return accuracy_of(from_screenshots(*files[: 3 if given else 2]), chosen_view(SCENE, 256))

    return shoot


SLOW = pytest.mark.slow


@pytest.mark.parametrize("ambient", [0.1, pytest.param(0.2, marks=SLOW), pytest.param(0.3, marks=SLOW), 0.5])
@pytest.mark.parametrize("fault", ["none", "gamma", "blur", "acne", "shift"])
def test_ambient_light_that_is_in_both_pictures_is_told_and_what_else_is_wrong(
    pictured: Callable, drawn: Callable, prepared: Callable, ambient: float, fault: str
) -> None:
    """And is not taken for soft edges; once it is undone, no shadow is lit."""
    exact, blurred = drawn(SCENE), ndimage.gaussian_filter(drawn(SCENE), 3.0)
    speckled = np.where(np.add.outer(np.arange(256), np.arange(256)) % 4 == 0, 0.75 * exact, exact)
    mask = {"blur": blurred, "acne": speckled, "shift": drawn(SCENE, shift=(2, 1))}.get(fault, exact)
    found = pictured(mask, ambient, power=1 / 2.2 if fault == "gamma" else 0.0)
    truth = prepared(SCENE)
    level = float(np.median((ambient / (ambient + 0.5 * truth.cosine))[truth.shadow_interior]))
    kinds = {kind.name: kind for kind in found.kinds}
    assert next(iter(kinds)) == "raised shadow"
    assert found.encoding.umbra == pytest.approx(level, abs=0.1 if fault == "blur" else 0.03)
    assert sum(f"its shadow is {found.encoding.umbra:.2f}, not 0" in line for line in found.warnings) == 1
    assert not any("edges are soft" in line for line in found.summary()) or fault == "blur"
    if fault == "blur":  # which lightens most of the umbra of such narrow shadows
        assert "give it with --ambient" in kinds["raised shadow"].line
        return
    assert "as ambient light in both pictures leaves it: give it with --ambient" in kinds["raised shadow"].line
    assert ("faint acne" in kinds, "shift" in kinds) == (fault == "acne", fault == "shift")
    assert sum(kinds[name].pixels for name in ("leak", "peter-panning") if name in kinds) < 20
    assert pictured(mask, ambient, given=True).encoding.umbra is None


def test_shadows_that_are_dark_somewhere_have_no_ambient_light(pictured: Callable, drawn: Callable) -> None:
    exact = drawn(SCENE)
    for mask in (exact, ndimage.gaussian_filter(exact, 4.0), np.ones_like(exact), np.maximum(exact, np.eye(256))):
        assert pictured(mask).encoding.umbra is None


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5])
def test_scattered_slightly_dark_pixels_are_no_edges(drawn: Callable, tmp_path: Path, share: float) -> None:
    faint = np.random.default_rng(5).random((256, 256)) < share
    found = accuracy_of(mask_from_array(np.where(faint, 0.8, 1) * drawn(SCENE)), chosen_view(SCENE, 256))
    (line,) = [kind.line for kind in found.kinds if kind.name == "faint acne"]
    assert float(line.split("%")[0]) == pytest.approx(100 * share, rel=0.15) and line.endswith("by 0.2")
    assert not any("edges are soft" in line for line in found.summary())
    dimmed = accuracy_of(mask_from_array(0.8 * drawn(SCENE)), chosen_view(SCENE, 256))
    assert [kind.name for kind in dimmed.kinds if kind.name in ("faint acne", "dimmed light")] == ["dimmed light"]
    assert not any("edges are soft" in line for line in dimmed.summary())


def test_black_screenshots_are_refused(shadowbench: Callable, png: Callable) -> None:
    black = png("black.png", np.zeros((64, 64)))
    answer = shadowbench("score", SCENE, "--lit", black, "--shadowed", black)
    assert answer.code == 2 and "lit − ambient is below 1/64 in every pixel" in answer.err


def test_a_row_is_kept_once_and_a_changed_mask_is_another(
    shadowbench: Callable, mask: Path, drawn: Callable, tmp_path: Path
) -> None:
    folder = tmp_path / "rows"

    def assert_added_once(name: str = "my-engine") -> None:
        words = ("score", SCENE, mask, "-o", folder, "--name", name)
        assert f"score, mask and difference of {name} added" in shadowbench(*words).out
        assert "already" in shadowbench(*words).out

    assert_added_once()
    (row,) = rows_of(folder)
    expected = {
        "schema": 1,
        "kind": "score",
        "scene": SCENE,
        "technique": "my-engine",
        "spec": "my-engine",
        "map_size": None,
        "view_size": 256,
        "renderer": "external: my-engine",
        "status": "ok",
    }
    assert {key: row[key] for key in expected} == expected
    assert list(row["metrics"]) == list(METRICS)
    np.testing.assert_array_equal(read_mask(folder / "masks" / f"{row['key']}.png"), read_mask(mask))
    assert (folder / "differences" / f"{row['key']}.png").exists()
    assert (folder / "truth" / f"{SCENE}.camera.light.256.png").exists()
    write_mask(mask, drawn(SCENE, shift=(0, 0.25)))
    assert_added_once()
    assert_added_once("another")
    write_mask(mask, drawn(SCENE))  # as it was at first: the newest row is the one that counts
    assert_added_once()
    rows = rows_of(folder)
    assert rows[-1]["metrics"] == row["metrics"] and len({row["key"] for row in rows}) == len(rows) == 4


def test_the_difference_shows_false_shadow_orange_and_false_light_blue(
    shadowbench: Callable, prepared: Callable, tmp_path: Path
) -> None:
    truth = prepared(SCENE)
    wrong = truth.visibility.copy()
    wrong[:, :128] = 1 - wrong[:, :128] * 0.5  # half a shadow where it is light, light where it is shadow
    write_mask(tmp_path / "mask.png", wrong)
    assert shadowbench("score", SCENE, tmp_path / "mask.png", "--diff", tmp_path / "diff.png").code == 0
    picture = np.asarray(Image.open(tmp_path / "diff.png")).astype(int)
    left = np.arange(256) < 128
    assert (picture[truth.shadow & left] == (0, 114, 178)).all()
    red, green, blue = picture[truth.lit & left].T
    assert (red > green).all() and (green > blue).all()
    assert np.ptp(picture[truth.valid & ~left], axis=-1).max() == 0


def test_errors_are_told_by_their_kind(comparison: Callable, prepared: Callable) -> None:
    truth = prepared(SCENE)
    acne = truth.visibility.copy()
    speckled = truth.lit_interior & (np.add.outer(np.arange(256), np.arange(256)) % 4 == 0)
    acne[speckled] = 0
    floating = np.where(truth.contact, 1, truth.visibility)
    hole = truth.visibility.copy()
    hole[truth.shadow_interior & ~truth.contact & (truth.squared_edge_distance > 8**2)] = 1
    grown = ndimage.minimum_filter(truth.visibility, 7)
    for mask, kind in ((acne, "acne"), (floating, "peter-panning"), (hole, "leak"), (grown, "displaced edge")):
        found = error_kinds(comparison(mask, SCENE), score(mask, truth))
        assert found[0].name == kind
    assert error_kinds(comparison(truth.visibility, SCENE), score(truth.visibility, truth)) == []


def test_the_share_of_a_kind_of_error_is_not_rounded_to_none_of_it(comparison: Callable, prepared: Callable) -> None:
    """One pixel of acne in some 30,000; and a share that counts pixels of another kind says so."""
    truth = prepared(SCENE)
    mask = truth.visibility.copy()
    mask[tuple(np.argwhere(truth.lit_interior)[0])] = 0
    acne = score(mask, truth)["acne"]
    (kind,) = error_kinds(comparison(mask, SCENE), score(mask, truth))
    assert acne < 5e-5 and kind.line == f"{100 * acne:.2g}% of the lit interior is dark (acne)"
    rows = np.arange(256)[:, np.newaxis]
    middle = int(np.median(np.argwhere(truth.contact & truth.shadow)[:, 0]))
    both = (truth.contact & (rows < middle)) | (truth.shadow & (rows > middle))
    mask = np.where(both, 1, truth.visibility)
    lines = {kind.name: kind.line for kind in error_kinds(comparison(mask, SCENE), score(mask, truth))}
    assert lines["peter-panning"].endswith("of the shadow next to its caster is lit, leaks included (contact)")
    assert lines["leak"].endswith("of the shadow's interior is lit, peter-panning included (leak)")


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (
            (),
            f"found neither a mask nor screenshots of {SCENE}; allowed: shadowbench score {SCENE} MASK.png, or "
            f"shadowbench score {SCENE} --lit LIT.png --shadowed SHADOWED.png; `shadowbench export` "
            "writes the scene to draw",
        ),
        (("{mask}", "--lit", "{mask}"), "found MASK and --lit; allowed: MASK, or"),
        (("--lit", "{mask}"), "found --lit; allowed"),
        (("{mask}", "--linear"), "--linear: found MASK; allowed: with --lit and --shadowed"),
        (("{mask}", "--name", "x"), "found one of them; allowed: both"),
        (("{mask}", "-o", "{folder}"), "found one of them; allowed: both"),
        (("{mask}", "-o", "{folder}", "--name", "a/b"), "--name: found 'a/b'; allowed: letters, digits"),
        (("{mask}", "--view", "no"), "view: found 'no'; allowed: camera"),
        (("{mask}", "--diff", "{folder}/diff.jpg"), "diff.jpg: found a name that ends with '.jpg'; allowed: .png"),
        (("{folder}/none.png",), "none.png: no such file"),
    ],
)
def test_bad_input_is_one_line(
    shadowbench: Callable, mask: Path, tmp_path: Path, arguments: tuple[str, ...], line: str
) -> None:
    answer = shadowbench("score", SCENE, *(part.format(mask=mask, folder=tmp_path) for part in arguments))
    assert (answer.code, answer.out) == (2, "")
    assert line in answer.err and answer.err.count("\n") == 1


@pytest.mark.parametrize("size", [1, 2, 3, 7, 8])
def test_pictures_of_few_pixels_are_scored(shadowbench: Callable, png: Callable, tmp_path: Path, size: int) -> None:
    for values in (np.ones((size, size)), np.zeros((size, size)), np.full((size, size), 0.5)):
        mask = png("small.png", values)
        answer = shadowbench("score", SCENE, mask, "--json", "--diff", tmp_path / "diff.png")
        assert answer.code == 0 and json.loads(answer.out)["view_size"] == size
    pictures = ("--lit", png("lit.png", np.ones((size, size))), "--shadowed", mask)
    assert shadowbench("score", SCENE, *pictures, "-o", tmp_path / "run", "--name", "x").code == 0


def test_the_difference_is_not_drawn_over_what_is_scored(
    shadowbench: Callable, mask: Path, png: Callable, tmp_path: Path
) -> None:
    (tmp_path / "link.png").symlink_to(mask)
    lit, ambient = png("lit.png", np.ones((8, 8))), png("ambient.png", np.zeros((8, 8)))
    pictures = ("--lit", lit, "--shadowed", lit, "--ambient", ambient)
    before = {file: file.read_bytes() for file in (mask, lit, ambient)}
    for given, over in (
        ((mask,), mask),
        ((mask,), mask.parent / "." / ".." / tmp_path.name / mask.name),
        ((tmp_path / "link.png",), mask),
        (pictures, lit),
        (pictures, ambient),
    ):
        answer = shadowbench("score", SCENE, *given, "--diff", over)
        assert (answer.code, answer.out) == (2, "")
        assert "--diff" in answer.err and "is one of the pictures to score; name another file" in answer.err
        assert answer.err.count("\n") == 1
    assert before == {file: file.read_bytes() for file in before}


def test_a_stored_truth_gives_the_scores_and_the_row_of_its_scene(
    shadowbench: Callable, tmp_path: Path, drawn: Callable
) -> None:
    """Of hard and soft shadows, of a mask and of screenshots; widths of penumbrae too."""
    scene, mask, folder = tmp_path / "soft.toml", tmp_path / "mask.png", tmp_path / "rows"
    scene.write_text(SOFT)
    for name in (SCENE, scene):
        stored = tmp_path / f"{Path(name).stem}.npz"
        assert shadowbench("truth", name, "-o", stored, "--view-size", "96").code == 0
        visibility = np.load(stored)["visibility"]
        write_mask(mask, ndimage.gaussian_filter(np.roll(visibility, 1, axis=1), 2.0))
        for given in ((mask,), ("--lit", mask, "--shadowed", mask)):
            found = [shadowbench("score", one, *given, "--json") for one in (name, stored)]
            assert found[0].code == 0 and found[0].out == found[1].out
        assert "added" in shadowbench("score", name, mask, "-o", folder, "--name", "mine").out
        assert "already holds" in shadowbench("score", stored, mask, "-o", folder, "--name", "mine").out
    assert json.loads(found[0].out)["metrics"].keys() == METRICS.keys()


DAMAGED: dict[str, dict[str, Any]] = {  # arrays in place of those of a truth
    "names": {"visibility": None},
    "range": {"area": np.ones((32, 32), np.float32) + 1},
    "about": {"about": '{"scene": 1}'},
    "path": {"about": ('"scene": "', '"scene": "../../')},
    "long": {"about": ('"name": "', f'"name": "{"é" * 70}')},
    "pickle": {"about": np.array([{}], dtype=object)},
}


@pytest.mark.parametrize("damage", ["missing", "pipe", "cut", "text", "array", "bytes", *DAMAGED])
def test_a_damaged_truth_is_one_line(shadowbench: Callable, tmp_path: Path, damage: str) -> None:
    stored, mask = tmp_path / "truth.npz", tmp_path / "mask.png"
    write_mask(mask, np.ones((32, 32)))
    assert shadowbench("truth", SCENE, "-o", stored, "--view-size", "32").code == 0
    arrays, data = dict(np.load(stored)), stored.read_bytes()
    stored.unlink()
    if damage == "pipe":
        os.mkfifo(stored)
    elif damage in ("cut", "text"):
        stored.write_bytes(data[: len(data) // 2] if damage == "cut" else b"scene")
    elif damage == "array":
        with stored.open("wb") as stream:
            np.save(stream, arrays["area"])
    elif damage == "bytes":
        with zipfile.ZipFile(stored, "w") as archive:
            for name in arrays:
                archive.writestr(f"{name}.npy", b"no array")
    elif damage != "missing":
        for name, value in DAMAGED[damage].items():
            arrays[name] = str(arrays[name]).replace(*value) if isinstance(value, tuple) else value
        np.savez(stored, **{name: value for name, value in arrays.items() if value is not None})
    answer = shadowbench("score", stored, mask)
    assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1)
    assert str(stored) in answer.err and "allowed: a file that `shadowbench truth` wrote" in answer.err


def test_a_stored_truth_is_of_one_view_and_size(shadowbench: Callable, tmp_path: Path) -> None:
    stored, mask = tmp_path / "truth.npz", tmp_path / "mask.png"
    assert shadowbench("truth", SCENE, "-o", stored, "--view-size", "32").code == 0
    write_mask(mask, np.ones((16, 16)))
    for given, line in (
        ((), f"{mask}: found 16 × 16 pixels; allowed: 32 × 32, as the truth has"),
        (("--sun",), f"--sun: {stored} is the truth of one view; allowed: a scene, with --sun"),
        (("--view", "camera"), "--view: "),
    ):
        answer = shadowbench("score", stored, mask, *given)
        assert (answer.code, answer.err.count("\n")) == (2, 1) and line in answer.err


def test_a_stored_truth_is_scored_without_embree_and_gl(shadowbench: Callable, mask: Path, tmp_path: Path) -> None:
    stored = tmp_path / "truth.npz"
    assert shadowbench("truth", SCENE, "-o", stored, "--view-size", "256").code == 0
    code = (
        "import sys; sys.modules.update(dict.fromkeys(['embreex', 'moderngl', 'glcontext', 'pyglm'])); "
        "from shadowbench.commands import app; app(sys.argv[1:], standalone_mode=False); "
        "assert not {'shadowbench.truths.packets', 'shadowbench.truths.soft'} & set(sys.modules)"
    )
    command = [sys.executable, "-c", code, "score", stored, mask, "-o", tmp_path / "rows", "--name", "mine"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0 and "score, mask and difference of mine added" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="only Linux tells which libraries are loaded")
def test_export_and_score_load_no_library_of_gl(mask: Path, tmp_path: Path) -> None:
    code = (
        "import sys; from shadowbench.commands import app; app(sys.argv[1:], standalone_mode=False); "
        "import shadowbench.pytest_plugin; assert not {'moderngl', 'glcontext', 'glm', 'pyglm'} & set(sys.modules); "
        "print(*{line.split('/')[-1].strip() for line in open('/proc/self/maps')})"
    )
    for arguments in (["export", SCENE, tmp_path / "out"], ["score", SCENE, mask, "-o", tmp_path / "o", "--name", "x"]):
        done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
        libraries = done.stdout.splitlines()[-1].split()
        assert any(name.startswith("libembree") for name in libraries) or "embree" in done.stdout
        assert [name for name in libraries if name.startswith(("libEGL", "libGL", "libOSMesa", "libgallium"))] == []
