"""Run folders with one defect each: one line that names the file, and never a traceback."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shadowbench.scores.masks import write_mask

Shadowbench = Callable[..., Any]
Spoil = Callable[[dict[str, Any]], Any]

SIZE = ("--view-size", "16", "--rounds", "1", "-q")
RUN = ("run", "cube-on-plane", "-t", "shadow-map:size=16", *SIZE)
STRESS = ("stress", "--quick", "--axis", "elevation", "-t", "unshadowed", "-q")
NESTED = "[" * 200_000 + "]" * 200_000


def put(*place: str, value: Any = ...) -> Spoil:
    """A change that replaces the value at a path, or removes it."""

    def spoil(row: dict[str, Any]) -> None:
        for name in place[:-1]:
            row = row[name]
        row[place[-1]] = value
        if value is ...:
            del row[place[-1]]

    return spoil


lacking = put


def text(line: str | bytes) -> Spoil:
    """A change that replaces the whole file."""
    return lambda row: line


NAN, INFINITY = float("nan"), float("inf")
SCORES: dict[str, Spoil] = {
    "NaN in a metric": put("metrics", "iou", value=NAN),
    "a metric as text": put("metrics", "iou", value="0.9"),
    "no metrics": lacking("metrics"),
    "a key that leads out of the folder": put("key", value="../../secret"),
    "a scene that leads out of the folder": put("scene", value="../../secret"),
    "a light that is a path": put("light", value="/etc/light"),
    "no full spec": lacking("full_spec"),
    "a map size of half a texel": put("map_size", value=0.5),
    "a view size below 1": put("view_size", value=-16),
    "coordinates of no kind": put("coordinates", value="polar"),
    "another status": put("status", value="fine"),
    "bytes that are null": put("gpu_bytes", value=None),
    "bytes beyond 64 bits": put("gpu_bytes", value=2**70),
    "a count of work that is half": put("work", "draws", value=0.5),
    "NaN in a fact": put("facts", value={"planes": NAN}),
    "NaN beside the warnings": put("input", value={"warnings": [], "gamma": NAN}),
    "infinity in a field that is unknown": put("novel", value=[{"deep": INFINITY}]),
    "another schema": put("schema", value=2),
    "no kind": lacking("kind"),
    "half a place on an axis": put("axis", value="elevation"),
    "200,000 brackets": text(NESTED),
    "half of a surrogate": text('{"schema": 1, "kind": "score", "key": "\\ud800"}'),
    "bytes that are no UTF-8": text(b'{"schema": 1, "kind": "score", "key": "\xff"}'),
    "a number of 5,000 digits": text('{"schema": 1, "kind": "score", "phase": 1' + 5000 * "0" + "}"),
}
TIMES: dict[str, Spoil] = {
    "infinity in a time": put("frame_ms", value=INFINITY),
    "a time below 0": put("frame_ms", value=-1.0),
    "0 rounds": put("n", value=0),
    "no ratio and no reason": put("ratio", value=None),
    "no IQR of a ratio": lacking("ratio_iqr"),
    "three quartiles": put("ratio_quartiles", value=[1.0, 2.0, 3.0]),
    "NaN beside the time of a pass": put("passes", value={"depth": {"ms": 1.0, "novel": NAN}}),
}
ABOUT: dict[str, Spoil] = {
    "device as text": put("device", value="a GPU"),
    "software as text": put("device", "software", value="yes"),
    "machine as a list": put("machine", value=["a processor"]),
    "assumptions that are numbers": put("assumptions", value=[1, 2]),
    "a command that is a list": put("command", value=["shadowbench", "run"]),
    "rounds as text": put("study", "rounds", value="nine"),
    "a key that leads out": put("keys", value=["../../secret"]),
    "another schema": put("schema", value=2),
    "no JSON": text("{"),
    "200,000 brackets": text(NESTED),
}
POINTS: dict[str, Spoil] = {
    "no axis value": lacking("axis_value"),
    "NaN on the axis": put("axis_value", value=NAN),
    "a light of no kind": put("light_kind", value="moon"),
    "no IoU": lacking("metrics", "iou"),
    "infinity in the flips": put("flips", value=INFINITY),
}


def cases(spoils: dict[str, Spoil]) -> list[Any]:
    return [pytest.param(spoil, id=name) for name, spoil in spoils.items()]


def spoilt(line: str, spoil: Spoil) -> bytes:
    row = json.loads(line)
    whole = spoil(row)
    if whole is None:
        whole = json.dumps(row)
    return whole if isinstance(whole, bytes) else whole.encode()


def spoil_row(folder: Path, kind: str, spoil: Spoil) -> str:
    """Changes the last row of a kind, and returns the message that must name it."""
    file = folder / "rows.jsonl"
    lines = file.read_text().splitlines()
    number = max(at for at, line in enumerate(lines) if json.loads(line)["kind"] == kind)
    parts = [spoilt(line, spoil) if at == number else line.encode() for at, line in enumerate(lines)]
    file.write_bytes(b"".join(part + b"\n" for part in parts))
    return f"{file} line {number + 1}: "


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, bytes]]:
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


@pytest.mark.parametrize(("kind", "spoil"), [
    *(pytest.param("score", *case.values, id=f"score: {case.id}") for case in cases(SCORES)),
    *(pytest.param("time", *case.values, id=f"time: {case.id}") for case in cases(TIMES)),
])  # fmt: skip
def test_a_row_that_no_run_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path, kind: str, spoil: Spoil
) -> None:
    good, bad = folder(*RUN).rename(tmp_path / "good"), folder(*RUN)
    where = spoil_row(bad, kind, spoil)
    before = (bad / "rows.jsonl").read_bytes()
    assert_refused(shadowbench("check", bad, "--baseline", good), where)
    assert_refused(shadowbench("check", good, "--baseline", bad), where)
    assert_refused(shadowbench("report", bad, "-o", tmp_path / "report.html"), where)
    assert_refused(shadowbench(*RUN, "-o", bad), where)
    assert (bad / "rows.jsonl").read_bytes() == before and not (tmp_path / "report.html").exists()


@pytest.mark.parametrize("spoil", cases(ABOUT))
def test_a_run_json_that_no_run_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path, spoil: Spoil
) -> None:
    good, bad = folder(*RUN).rename(tmp_path / "good"), folder(*RUN)
    file = bad / "run.json"
    file.write_bytes(spoilt(file.read_text(), spoil))
    assert_refused(shadowbench("check", bad, "--baseline", good), f"{file}: ")
    assert_refused(shadowbench("report", bad, "-o", tmp_path / "report.html"), f"{file}: ")


@pytest.mark.parametrize(
    ("table", "named"),
    [
        ("scene,iou\ns,0.9\n", "no column `key`"),
        ("key,bias_of\nk,b\n", "no sweep"),
        ("key,spec,map_size,bias_of,bias_factor\nk,s,16,s,twice\n", "no sweep"),
        ("key,spec,map_size,bias_of,bias_factor,bias_also\nk,s,16,s,2,s × much\n", "no sweep"),
    ],
)
def test_a_table_that_no_command_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path, table: str, named: str
) -> None:
    bad = folder(*RUN)
    (bad / "table.csv").write_bytes(table.encode("latin-1"))
    answer = shadowbench("report", bad, "-o", tmp_path / "report.html")
    assert_refused(answer, f"{bad / 'table.csv'}: ")
    assert named in answer.err


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


@pytest.mark.parametrize("spoil", cases(POINTS))
def test_a_row_that_no_sweep_writes_is_one_line(
    shadowbench: Shadowbench, folder: Callable[..., Path], tmp_path: Path, spoil: Spoil
) -> None:
    bad = folder(*STRESS)
    where = spoil_row(bad, "score", spoil)
    before = (bad / "rows.jsonl").read_bytes()
    assert_refused(shadowbench("report", bad, "-o", tmp_path / "report.html"), where)
    assert_refused(shadowbench(*STRESS, "-o", bad), where)
    assert (bad / "rows.jsonl").read_bytes() == before
