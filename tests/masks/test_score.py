"""`score` as a command: its output, errors, warnings, pictures and rows."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from scipy import ndimage

from shadowbench import api
from shadowbench.errors import number
from shadowbench.masks.accuracy import accuracy_of
from shadowbench.masks.export import clip_of
from shadowbench.masks.inputs import mask_from_array
from shadowbench.measure.campaign import Block, Cell, LogReporter
from shadowbench.plugin.spec import parse_spec
from shadowbench.scenes.opening import chosen_view
from shadowbench.scores.masks import read_mask, write_mask
from shadowbench.scores.metrics import METRICS, score
from shadowbench.scores.motion import MOTION
from shadowbench.truths.cache import cached_truth
from tests.masks.conftest import srgb

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


def test_a_mask_of_soft_shadows_is_scored_with_the_error_of_the_truth(shadowbench: Callable, tmp_path: Path) -> None:
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

    outs = [shadowbench("score", scene, file).out for file in files]
    printed = [{words[0]: words[1] for line in out.splitlines() if (words := line.split())} for out in outs]
    assert printed[0]["rmse"] == f"<{number(exact['truth_error'])}"
    assert printed[1]["rmse_pen"] == number(other["metrics"]["rmse_pen"])
    assert not {"contact", "acne", "leak", "edge_p95"} & printed[0].keys(), "made for hard edges"
    assert f"RMSE {other['metrics']['rmse']:.2g}, in the penumbra {other['metrics']['rmse_pen']:.2g}" in outs[1]

    folder, wrong = tmp_path / "rows", tmp_path / "wrong.png"
    assert shadowbench("score", scene, files[1], "-o", folder, "--name", "mine", "--diff", wrong).code == 0
    with Image.open(wrong) as picture:
        assert picture.size == (size, size)
    (row,) = rows_of(folder)
    assert (row["metrics"], row["width_share"]) == (other["metrics"], other["width_share"])


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
    names = {"scene": SCENE, "technique": "my-engine", "spec": "my-engine", "renderer": "external: my-engine"}
    expected = names | {"schema": 1, "kind": "score", "map_size": None, "view_size": 256, "status": "ok"}
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


def test_errors_are_said_in_words_the_leading_one_first(prepared: Callable) -> None:
    truth, view = prepared(SCENE), chosen_view(SCENE, 256)
    speckled = truth.lit_interior & (np.add.outer(np.arange(256), np.arange(256)) % 4 == 0)
    floating = np.where(truth.contact, 1, truth.visibility)
    hole = truth.shadow_interior & ~truth.contact & (truth.squared_edge_distance > 8**2)
    for mask, first, words in (
        (np.where(speckled, 0, truth.visibility), "acne", "% of the lit interior is dark"),
        (floating, "contact", "% of the shadow next to its caster is lit (peter-panning)"),
        (np.where(hole, 1, truth.visibility), "leak", "% of the shadow's interior is lit"),
        (ndimage.minimum_filter(truth.visibility, 3), "edge_px", " px from the true ones on average"),
    ):
        accuracy = accuracy_of(mask_from_array(mask), view)
        name, line = next(iter(accuracy.errors.items()))
        assert name == first and line.endswith(words) and f"{name}: {line}" in accuracy.summary()
    assert accuracy_of(mask_from_array(truth.visibility), view).errors == {}


def test_bad_input_is_one_line_that_says_what_is_allowed(
    shadowbench: Callable, mask: Path, png: Callable, tmp_path: Path
) -> None:
    exact, run = read_mask(mask), ("-o", tmp_path / "rows", "--name", "mine")
    for name, values in (("flipped", exact[::-1]), ("mirrored", exact[:, ::-1]), ("inverted", 1 - exact)):
        write_mask(tmp_path / f"{name}.png", values)
    black = png("black.png", np.zeros((64, 64)))
    (tmp_path / "link.png").symlink_to(mask)
    for arguments, line in [
        ((SCENE, tmp_path / "flipped.png", *run), "flipped.png: is flipped vertically, against the truth of stairs"),
        ((SCENE, tmp_path / "mirrored.png", *run), "is flipped horizontally,"),
        ((SCENE, tmp_path / "inverted.png", *run), "is inverted,"),
        ((SCENE,), "found no picture; allowed: MASK; or --lit and --shadowed, with or without --ambient and --linear"),
        ((SCENE, mask, "--lit", mask), "found MASK and --lit; allowed: MASK; or"),
        ((SCENE, "--lit", mask), "found --lit; allowed"),
        ((SCENE, mask, "--linear"), "found MASK and --linear; allowed"),
        ((SCENE, "--lit", black, "--shadowed", black), "lit − ambient is below 1/64 in every pixel"),
        ((SCENE, mask, "--name", "x"), "found one of them; allowed: both"),
        ((SCENE, mask, "-o", tmp_path / "rows", "--name", "a/b"), "--name: found 'a/b'; allowed: letters, digits"),
        ((SCENE, mask, "--view", "no"), "view: found 'no'; allowed: camera"),
        ((SCENE, mask, "--diff", tmp_path / "diff.jpg"), "diff.jpg: found a name that ends with '.jpg'; allowed: .png"),
        ((SCENE, tmp_path / "link.png", "--diff", mask), "is one of the pictures to score; name another file"),
        ((SCENE, tmp_path / "none.png"), "none.png: no such file"),
        ((SCENE, tmp_path), "is not in a folder that `export --sequence` wrote; allowed: pictures of frames"),
    ]:
        answer = shadowbench("score", *arguments)
        assert (answer.code, answer.out, answer.err.count("\n")) == (2, "", 1), line
        assert line in answer.err
    assert not (tmp_path / "rows").exists()


@pytest.mark.slow
def test_masks_of_frames_have_the_scores_of_the_run_that_drew_them_and_exchanged_ones_show(
    bench: Any, shadowbench: Callable, tmp_path: Path
) -> None:
    """Of a map that is fitted to the view of each frame, and so crawls."""
    count, out, masks = 8, tmp_path / "out", tmp_path / "out" / "masks"
    assert shadowbench("export", SCENE, out, "--view-size", "96", "--sequence", "pan", "--frames", str(count)).code == 0
    frames = clip_of(chosen_view(SCENE, 96), "pan", count).frames
    cell = Cell(parse_spec("shadow-map:size=128,fit=view", bench.techniques))
    block = Block(frames, (cell,), place={"sequence": "pan", "frames": count})
    with bench.campaign(tmp_path / "run", LogReporter()) as campaign:
        ((result,),) = campaign.measure([block])
    masks.mkdir()
    for index, drawn in enumerate(campaign.drawer.draw(block, cell)):
        write_mask(masks / f"{index:03}.png", drawn.visibility)
    rows = "-o", tmp_path / "rows", "--name", "mine"
    scored = json.loads(shadowbench("score", SCENE, masks, "--json", *rows).out)
    for field in ("metrics", "by_frame", "pop_frame", "sequence", "frames", "mask_sha256"):
        assert scored[field] == result.score[field], field
    (row,) = rows_of(tmp_path / "rows")
    assert row["metrics"] == scored["metrics"] and (row["sequence"], row["frames"]) == ("pan", count)
    assert "already holds" in shadowbench("score", SCENE, masks, *rows).out
    (masks / "004.png").rename(masks / "last.png")
    answer = shadowbench("score", SCENE, masks)
    assert (answer.code, answer.err.count("\n")) == (2, 1) and "004.png: no such file" in answer.err
    (masks / "006.png").rename(masks / "004.png")
    (masks / "last.png").rename(masks / "006.png")
    exchanged = json.loads(shadowbench("score", SCENE, masks, "--json", *rows).out)
    assert exchanged["metrics"]["flicker"] > 2 * scored["metrics"]["flicker"]
    assert len(rows_of(tmp_path / "rows")) == 2
    Image.open(masks / "002.png").transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(masks / "002.png")
    answer = shadowbench("score", SCENE, masks)
    assert answer.code == 2 and "002.png: is flipped" in answer.err


@pytest.mark.parametrize("sequence", ["slow-sun", "moving-caster"])
def test_screenshots_of_frames_of_the_truth_have_no_error(shadowbench: Callable, tmp_path: Path, sequence: str) -> None:
    """Shaded by N·L, as the light moves."""
    out = tmp_path / "out"
    assert shadowbench("export", SCENE, out, "--view-size", "64", "--sequence", sequence, "--frames", "4").code == 0
    for index, frame in enumerate(clip_of(chosen_view(SCENE, 64), sequence, 4).frames):
        truth = cached_truth(frame, 1)
        for name, picture in (("lit", truth.cosine), ("shadowed", truth.cosine * truth.visibility)):
            (out / name).mkdir(exist_ok=True)
            Image.fromarray(np.rint(255 * srgb(picture)).astype(np.uint8)).save(out / name / f"{index:03}.png")
    metrics = json.loads(
        shadowbench("score", SCENE, "--lit", out / "lit", "--shadowed", out / "shadowed", "--json").out
    )["metrics"]
    assert metrics["iou"] == 1
    assert {metrics[name] for name in MOTION} <= {0, None} and metrics["flicker"] == 0
