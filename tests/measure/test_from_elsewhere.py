"""Run folders with one defect each: one line that names the file, and never a traceback."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.errors import InputError
from shadowbench.measure.row_store import read_run_file, stream_rows
from shadowbench.results.frame import read_sweep_positions
from shadowbench.scores.masks import write_mask

Shadowbench = Callable[..., Any]

SIZE = ("--view-size", "16", "--rounds", "1", "-q")
RUN = ("run", "cube-on-plane", "-t", "shadow-map:size=16", *SIZE)
STRESS = ("stress", "--quick", "--axis", "elevation", "-t", "unshadowed", "-q")
NESTED = "[" * 200_000 + "]" * 200_000
NAN, INFINITY = float("nan"), float("inf")
NONE = object()  # a field is left out

Spoilt = dict[str, tuple[str, Any] | str | bytes]
"""What is wrong: a field, by names with dots between them, and its value; or the whole text."""

SCORES: Spoilt = {
    "NaN in a metric": ("metrics.iou", NAN),
    "a metric as text": ("metrics.iou", "0.9"),
    "no metrics": ("metrics", NONE),
    "a key that leads out of the folder": ("key", "../../secret"),
    "a scene that leads out of the folder": ("scene", "../../secret"),
    "a light that is a path": ("light", "/etc/light"),
    "no full spec": ("full_spec", NONE),
    "a map size of half a texel": ("map_size", 0.5),
    "a view size below 1": ("view_size", -16),
    "coordinates of no kind": ("coordinates", "polar"),
    "another status": ("status", "fine"),
    "bytes that are null": ("gpu_bytes", None),
    "bytes beyond 64 bits": ("gpu_bytes", 2**70),
    "a count of work that is half": ("work.draws", 0.5),
    "NaN in a fact": ("facts", {"planes": NAN}),
    "NaN beside the warnings": ("input", {"warnings": [], "gamma": NAN}),
    "infinity in a field that is unknown": ("novel", [{"deep": INFINITY}]),
    "another schema": ("schema", 2),
    "no kind": ("kind", NONE),
    "half a place on an axis": ("axis", "elevation"),
    "200,000 brackets": NESTED,
    "half of a surrogate": '{"schema": 1, "kind": "score", "key": "\\ud800"}',
    "bytes that are no UTF-8": b'{"schema": 1, "kind": "score", "key": "\xff"}',
    "a number of 5,000 digits": '{"schema": 1, "kind": "score", "phase": 1' + 5000 * "0" + "}",
}
TIMES: Spoilt = {
    "infinity in a time": ("frame_ms", INFINITY),
    "a time below 0": ("frame_ms", -1.0),
    "0 rounds": ("n", 0),
    "no ratio and no reason": ("ratio", None),
    "no IQR of a ratio": ("ratio_iqr", NONE),
    "three quartiles": ("ratio_quartiles", [1.0, 2.0, 3.0]),
    "NaN beside the time of a pass": ("passes", {"depth": {"ms": 1.0, "novel": NAN}}),
}
ABOUT: Spoilt = {
    "device as text": ("device", "a GPU"),
    "software as text": ("device.software", "yes"),
    "machine as a list": ("machine", ["a processor"]),
    "assumptions that are numbers": ("assumptions", [1, 2]),
    "a command that is a list": ("command", ["shadowbench", "run"]),
    "rounds as text": ("study.rounds", "nine"),
    "a key that leads out": ("keys", ["../../secret"]),
    "another schema": ("schema", 2),
    "no JSON": "{",
    "200,000 brackets": NESTED,
}
POINTS: Spoilt = {
    "no axis value": ("axis_value", NONE),
    "NaN on the axis": ("axis_value", NAN),
    "a light of no kind": ("light_kind", "moon"),
    "no IoU": ("metrics.iou", NONE),
    "infinity in the flips": ("flips", INFINITY),
}


def spoilt(line: str, spoil: tuple[str, Any] | str | bytes) -> bytes:
    if not isinstance(spoil, tuple):
        return spoil if isinstance(spoil, bytes) else spoil.encode()
    whole = json.loads(line)
    *places, last = spoil[0].split(".")
    row = whole
    for name in places:
        row = row[name]
    row[last] = spoil[1]
    if spoil[1] is NONE:
        del row[last]
    return json.dumps(whole).encode()


def spoil_row(folder: Path, kind: str, spoil: tuple[str, Any] | str | bytes) -> str:
    """Changes the last row of a kind, and returns the message that must name it."""
    file = folder / "rows.jsonl"
    lines = file.read_text().splitlines()
    number = max(at for at, line in enumerate(lines) if json.loads(line)["kind"] == kind)
    parts = [spoilt(line, spoil) if at == number else line.encode() for at, line in enumerate(lines)]
    file.write_bytes(b"".join(part + b"\n" for part in parts))
    return f"{file} line {number + 1}: "


@pytest.fixture(scope="module")
def measured() -> dict[str, dict[str, bytes]]:
    """Files of run folders, measured once, by command."""
    return {}


@pytest.fixture
def folder(shadowbench: Shadowbench, measured: dict[str, dict[str, bytes]], tmp_path: Path) -> Callable[..., Path]:
    """A copy of a folder as written by a command."""

    def make(*command: str) -> Path:
        out = tmp_path / command[0]
        if command[0] not in measured:
            assert shadowbench(*command, "-o", out).code == 0
            measured[command[0]] = {name: (out / name).read_bytes() for name in ("rows.jsonl", "run.json", "table.csv")}
        out.mkdir(exist_ok=True)
        for name, content in measured[command[0]].items():
            (out / name).write_bytes(content)
        return out

    return make


def assert_refused(answer: Any, where: str) -> None:
    assert answer.code == 2 and "Traceback" not in answer.err, answer.err[-2000:]
    assert answer.err.count("\n") == 1 and answer.err.startswith(f"shadowbench: {where}"), answer.err
    assert len(answer.err) < len(where) + 300


def test_what_no_command_writes_is_one_line_of_its_reader(folder: Callable[..., Path]) -> None:
    for command, kind, table in ((RUN, "score", SCORES), (RUN, "time", TIMES), (STRESS, "score", POINTS)):
        for what, spoil in table.items():
            bad = folder(*command)
            where = spoil_row(bad, kind, spoil)
            with pytest.raises(InputError) as error:
                list(stream_rows(bad / "rows.jsonl"))
            assert str(error.value).startswith(where) and len(str(error.value)) < len(where) + 300, what
    for what, spoil in ABOUT.items():
        file = folder(*RUN) / "run.json"
        file.write_bytes(spoilt(file.read_text(), spoil))
        with pytest.raises(InputError) as error:
            read_run_file(file)
        assert str(error.value).startswith(f"{file}: ") and len(str(error.value)) < len(str(file)) + 300, what


def test_every_command_refuses_it_and_leaves_it_as_it_is(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path
) -> None:
    good, bad = folder(*RUN).rename(tmp_path / "good"), folder(*RUN)
    report = ("report", bad, "-o", tmp_path / "report.html")
    about = (bad / "run.json").read_bytes()
    (bad / "run.json").write_text("{")
    for command in (("check", bad, "--baseline", good), report):
        assert_refused(shadowbench(*command), f"{bad / 'run.json'}: ")
    (bad / "run.json").write_bytes(about)
    where = spoil_row(bad, "time", TIMES["a time below 0"])
    before = (bad / "rows.jsonl").read_bytes()
    for command in (("check", bad, "--baseline", good), ("check", good, "--baseline", bad), report, (*RUN, "-o", bad)):
        assert_refused(shadowbench(*command), where)
    assert (bad / "rows.jsonl").read_bytes() == before and not (tmp_path / "report.html").exists()
    swept = folder(*STRESS)
    where = spoil_row(swept, "score", POINTS["no axis value"])
    for command in (("report", swept, "-o", tmp_path / "report.html"), (*STRESS, "-o", swept)):
        assert_refused(shadowbench(*command), where)


def test_a_table_that_no_command_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path
) -> None:
    file = folder(*RUN) / "table.csv"
    file.write_text("scene,iou\ns,0.9\n")
    answer = shadowbench("report", file.parent, "-o", tmp_path / "report.html")
    assert_refused(answer, f"{file}: ")
    assert "no column `key`" in answer.err
    for text in ("bias_of,bias_factor\nk,16,s,twice\n", "bias_of,bias_factor,bias_also\nk,16,s,2,s × much\n"):
        file.write_text(f"spec,map_size,{text}", encoding="utf-8")
        with pytest.raises(InputError, match="no sweep"):
            read_sweep_positions(file)


@pytest.mark.parametrize("kind", ["masks", "truth", "pictures"])
@pytest.mark.parametrize("size", [None, 17])
def test_an_image_that_no_run_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path, kind: str, size: int | None
) -> None:
    bad = folder(*RUN)
    row = json.loads((bad / "rows.jsonl").read_text().splitlines()[0])
    files = {
        "truth": bad / "truth" / "cube-on-plane.camera.light.16.png",
        "masks": bad / "masks" / f"{row['key']}.png",
        "pictures": bad / "pictures" / f"{row['key']}.png",
    }
    for name, file in files.items():
        file.parent.mkdir(exist_ok=True)
        write_mask(file, np.ones((size if name == kind and size else 16,) * 2))
    if size is None:
        files[kind].write_bytes(files[kind].read_bytes()[:40])
    answer = shadowbench("report", bad, "-o", tmp_path / "report.html")
    if kind == "pictures" and size is not None:
        assert answer.code == 0, "a picture is only shown"
    else:
        assert_refused(answer, f"{files[kind]}: ")
