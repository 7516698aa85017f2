"""`recommend` as a command: its choice, its output, its files and its errors."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.maps.biases import Texel

SCENE = """
[camera]
position = [0, 3, 6]
target = [0, 0, 0]
[light]
kind = "directional"
direction = [0.3, -1, 0.2]
{light}
[[mesh]]
shape = "plane"
scale = 6
[[mesh]]
shape = "box"
casts = false
translate = [0, -3, 0]
"""

DARK_TABLE = """
[camera]
position = [0.0, 2.2, 0.9]
target = [0.0, 1.0, 0.0]
fov_y = 30.0
[light]
kind = "directional"
direction = [0.4, -1.0, -0.2]
[[mesh]]
shape = "plane"
scale = {ground}
[[mesh]]
shape = "box"
scale = [2.0, 1.0, 2.0]
translate = [0.0, 0.5, 0.0]
[[mesh]]
shape = "box"
scale = [12.0, 0.1, 12.0]
translate = [-1.2, 4.0, 0.6]
"""


VEIL = """
[camera]
position = [0.0, 1.5, 1.2]
target = [0.0, 0.0, 0.0]
fov_y = 40.0
[light]
kind = "directional"
direction = [0.0, -1.0, 0.0]
angular_radius = 8.0
[[mesh]]
shape = "plane"
scale = 6.0
[[mesh]]
shape = "box"
scale = [6.0, 0.02, 0.15]
translate = [0.0, 2.0, 0.0]
"""


@pytest.fixture
def scene(tmp_path: Path) -> Callable[..., Path]:
    """A floor, with its box out of sight below."""

    def write(light: str = "") -> Path:
        file = tmp_path / "box.toml"
        file.write_text(SCENE.format(light=light))
        return file

    return write


def lines(folder: Path) -> int:
    return len((folder / "rows.jsonl").read_text().splitlines())


def test_the_choice_meets_the_target_its_rows_are_kept_and_a_second_call_measures_nothing(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    folder = tmp_path / "rows"
    command = ("recommend", "sphere-and-torus", "--view-size", "96", "-o", folder)
    answer = shadowbench(*command, "--json")
    assert answer.code == 0, answer.err
    found = json.loads(answer.out)
    assert found["choice"]["metrics"]["iou"] >= 0.99
    assert (found["ranked_by"], found["device"]) == ("predicted_ms", "NVIDIA H100 80GB HBM3")
    met = [one for one in found["evidence"] if one["metrics"]["iou"] >= 0.99]
    assert found["choice"]["cost"] == min(one["cost"] for one in met if one["cost"] is not None)
    assert found["measured"] == lines(folder) <= 0.2 * found["space"]
    keys = {json.loads(line)["key"] for line in (folder / "rows.jsonl").read_text().splitlines()}
    assert {one["key"] for one in found["evidence"]} == keys
    assert (folder / "table.csv").exists() and (folder / "run.json").exists()

    again = shadowbench(*command)
    assert again.code == 0 and lines(folder) == found["measured"]
    assert again.out.startswith("sphere-and-torus, IoU ≥ 0.99, by predicted times on NVIDIA H100 80GB HBM3\n")
    assert "not tried: cube-map, " in again.out and len(re.findall("^not tried", again.out, re.MULTILINE)) <= 4
    (why,) = [one["why"] for one in found["excluded"] if one["what"] == "cube-map"]
    assert why == "supports point and spot light, not directional"
    assert f"{found['measured']} of {found['space']} specs measured" in again.out
    rest = re.findall(
        r"(\d+) (?:predicted to (?:cost at least as much as the choice|miss the target)|without a cost)", again.out
    )
    excluded = sum(one["specs"] for one in found["excluded"])
    assert sum(map(int, rest)) == found["space"] - found["measured"] - excluded > 0, "every spec is accounted for"
    assert sum(sum(value for name, value in one.items() if name != "technique") for one in found["untried"]) == sum(
        map(int, rest)
    )
    assert "maps are scored in one phase" in again.out


def test_without_a_gpu_the_device_on_record_ranks_and_work_only_if_asked(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    """On an H100 volumes take longer than cascades, whatever their work; a budget between the two leaves them out."""
    command = ("recommend", "stairs", "--view-size", 128, "-o", tmp_path)
    by_work = shadowbench(*command, "--by", "work")
    assert by_work.code == 0 and re.search(r"^choice +shadow-volume", by_work.out, re.MULTILINE)
    assert by_work.out.startswith("stairs, IoU ≥ 0.99, by work;") and not re.search(r"\bms\b", by_work.out), (
        "one currency"
    )
    found = json.loads(shadowbench(*command, "--budget-ms", 1, "--json").out)
    named = json.loads(shadowbench(*command, "--device", "h100", "--budget-ms", 1, "--json").out)
    assert named["choice"] == found["choice"]
    assert (found["ranked_by"], found["device"]) == ("predicted_ms", "NVIDIA H100 80GB HBM3")
    assert found["choice"]["cost"] <= 1
    assert not found["choice"]["spec"].startswith("shadow-volume")
    assert "ray-traced" in {one["what"].split()[0] for one in found["excluded"]}
    assert not any("frame_ms" in line for line in (tmp_path / "rows.jsonl").read_text().splitlines()), (
        "nothing is timed"
    )
    wrong = shadowbench(*command, "--device", "voodoo")
    assert wrong.code == 2 and wrong.err.startswith(
        "shadowbench: --device: 'voodoo' names 0 devices with times; allowed: NVIDIA"
    )


def test_export_writes_parameters_and_whole_shaders(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    folder = tmp_path / "made" / "mine"
    easy = ("canopy", "--min-iou", "0.9")  # for which a map costs less than volumes
    answer = shadowbench("recommend", *easy, "--view-size", "96", "-o", tmp_path / "rows", "--export", folder, "--json")
    assert answer.code == 0, answer.err
    written = json.loads((folder / "parameters.json").read_text())
    assert written["spec"] == json.loads(answer.out)["choice"]["spec"]
    texts = {file.name: file.read_text() for file in folder.iterdir() if file.suffix != ".json"}
    assert set(texts) == set(written["uniforms"]) and texts
    chosen = written["parameters"]
    assert chosen["bias"] == {"name": "texel", **Texel().model_dump()}
    resolve = next(name for name in texts if name.endswith("-resolve.frag"))
    assert f"#define SIZE {chosen['size']}\n" in texts[resolve]
    assert written["uniforms"][resolve]["bias_limit"] == chosen["bias"]["limit"]
    assert all(text.startswith("#version 410 core\n") and "#include" not in text for text in texts.values())
    assert all("void main" in text for text in texts.values())


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--min-iou", "1.5"), "--min-iou: found 1.5; allowed: above 0, up to 1"),
        (("--min-iou", "nan"), "--min-iou: found nan"),
        (("--max-edge-px", "-1"), "--max-edge-px: found -1; allowed: 0 and more"),
        (("--budget-ms", "0"), "--budget-ms: found 0; allowed: above 0"),
        (("--min-iou", "0.9", "--max-edge-px", "1"), "allowed: one of them"),
        (("--max-rmse", "nan"), "--max-rmse: found nan; allowed: 0 to 1"),
        (("--max-rmse", "0.1", "--min-iou", "0.9"), "--min-iou and --max-rmse: found both; allowed: one of them"),
        (("--view", "nowhere"), "nowhere"),
        (("-t", "shadowmap"), "unknown technique 'shadowmap'; did you mean 'shadow-map'?"),
        (("-t", "shadow-map:size=512"), "technique 'shadow-map:size=512': found parameters"),
        (("--budget-ms", "3", "--by", "work"), "--budget-ms: found with --by work, which has no times; allowed: "),
        (("--by", "clock"), "--by: found 'clock'; allowed: work, device, time"),
        (("--by", "time", "--device", "h100"), "--device: found with --by time; allowed: --by device"),
        (("-t", "cube-map"), "nothing to search: cube-map supports point and spot light, not directional; allowed: "),
    ],
)
def test_invalid_option_values_are_one_line(
    shadowbench: Callable[..., Any], tmp_path: Path, options: tuple[str, ...], said: str
) -> None:
    answer = shadowbench("recommend", "cube-on-plane", "-o", tmp_path / "rows", *options)
    assert answer.code == 2 and said in answer.err and len(answer.err.splitlines()) == 1
    assert not (tmp_path / "rows" / "rows.jsonl").exists()


def test_times_of_this_machine_rank_if_asked_and_an_impossible_budget_is_not_met(
    shadowbench: Callable[..., Any], tmp_path: Path
) -> None:
    command = ("recommend", "cube-on-plane", "--view-size", "64", "-o", tmp_path / "rows", "--by", "time")
    answer = shadowbench(*command, "--budget-ms", "0.0001")
    assert answer.code == 1
    assert "closest" in answer.out and "obstacle: the budget" in answer.out
    answer = shadowbench(*command, "--json")
    assert answer.code == 0
    found = json.loads(answer.out)
    assert found["ranked_by"] == "frame_ms" and found["choice"]["cost"] > 0


@pytest.mark.slow
@pytest.mark.parametrize(("iqr", "mark"), [(0.0, False), (9.0, True)])
def test_a_time_that_varied_much_is_marked(
    shadowbench: Callable[..., Any], tmp_path: Path, iqr: float, mark: bool
) -> None:
    folder = tmp_path / "rows"
    command = ("recommend", "cube-on-plane", "--view-size", "64", "-o", folder, "--by", "time")
    assert shadowbench(*command, "-q").code == 0
    rows = [json.loads(line) for line in (folder / "rows.jsonl").read_text().splitlines()]
    for row in rows:
        if row["kind"] == "time":
            row["ratio_iqr"] = iqr
    (folder / "rows.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    out = shadowbench(*command).out
    (choice,) = [line for line in out.splitlines() if line.startswith("choice")]
    assert (" ~" in choice) == ("~: " in out) == mark


def test_only_the_techniques_asked_for_are_searched(shadowbench: Callable[..., Any], tmp_path: Path) -> None:
    command = ("recommend", "stairs", "--view-size", "64", "-o", tmp_path / "rows", "-t", "planar-projection")
    met = json.loads(shadowbench(*command, "-t", "shadow-volume", "--json").out)
    assert met["techniques"] == ["planar-projection", "shadow-volume"]
    assert {one["spec"] for one in met["evidence"]} <= {"planar-projection", "shadow-volume"}
    missed = shadowbench("recommend", "street", *command[2:])
    assert missed.code == 1 and missed.out.startswith("street, IoU ≥ 0.99, of planar-projection, by predicted times")
    assert "nothing measured of planar-projection meets IoU ≥ 0.99; the closest is planar-projection: IoU" in missed.out


@pytest.mark.parametrize(
    ("ground", "target"),
    [(400.0, ("--max-edge-px", "0.5")), (40.0, ("--max-edge-px", "0.5")), (40.0, ("--min-iou", "1"))],
)
def test_in_a_picture_wholly_in_shadow_drawing_no_shadow_meets_no_target(
    shadowbench: Callable[..., Any], tmp_path: Path, target: tuple[str, str], ground: float
) -> None:
    """Such a mask has no edge; `planar-projection` finds the table's plane on the smaller ground only."""
    file = tmp_path / "dark.toml"
    file.write_text(DARK_TABLE.format(ground=ground))
    answer = shadowbench("recommend", file, "--view-size", "64", "-o", tmp_path / "rows", "--json", *target)
    assert answer.code == 0, answer.err
    found = json.loads(answer.out)
    assert found["choice"]["metrics"]["iou"] == 1.0 and found["choice"]["metrics"]["edge_px"] is None
    projected = [one["metrics"]["iou"] for one in found["evidence"] if one["spec"] == "planar-projection"]
    assert projected == ([1.0] if ground == 40.0 else [])


@pytest.mark.slow
def test_a_penumbra_is_judged_by_its_rmse(
    shadowbench: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A bar before a wide sun: nowhere is darker than half, which is no shadow to IoU alone, as a note says."""
    monkeypatch.setattr("shadowbench.advice.search.SIZES", (256, 512))  # all of them are measured where none suffices
    file = tmp_path / "veil.toml"
    file.write_text(VEIL)
    arguments = ("recommend", file, "--view-size", "64", "-o", tmp_path / "rows", "--json")
    hard, met, missed = (
        shadowbench(*arguments, *target)
        for target in (("--min-iou", "0.99"), ("--max-rmse", "0.2"), ("--max-rmse", "0.0001"))
    )
    assert [answer.code for answer in (hard, met, missed)] == [0, 0, 1], met.err + missed.err
    choice, none = (json.loads(answer.out)["choice"] for answer in (met, hard))
    assert none["spec"] == "unshadowed" and choice["spec"] != "unshadowed"
    assert 0.001 < choice["metrics"]["rmse"] <= 0.2
    assert any(
        line.startswith("nothing measured meets RMSE ≤ 0.0001; ") for line in json.loads(missed.out)["in_the_way"]
    )
    assert not any("contact" in line or "map size" in line for line in json.loads(missed.out)["in_the_way"])
    notes = [json.loads(answer.out)["notes"] for answer in (hard, met)]
    judged = "IoU judges where visibility is ½"
    assert [any(note.startswith(judged) for note in told) for told in notes] == [True, False]


@pytest.mark.parametrize("light", ["", "angular_radius = 0.3"])
def test_where_nothing_seen_is_in_shadow_drawing_none_is_enough(
    shadowbench: Callable[..., Any], scene: Callable[..., Path], tmp_path: Path, light: str
) -> None:
    """Also under a light whose penumbra no pixel hits, which is judged as a hard one."""
    answer = shadowbench("recommend", scene(light), "--view-size", "32", "-o", tmp_path / "rows", "--json")
    assert answer.code == 0, answer.err
    found = json.loads(answer.out)
    assert found["choice"]["spec"] == "unshadowed" and found["measured"] == 1
    assert found["target"]["metric"] == "iou" and not any("soft" in note for note in found["notes"])
