"""Several machines, by `--part` and `merge` or by `--dask`, give the rows, images and tables of one."""

import logging
import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from tests.promises.conftest import Record, unsigned

Command = Callable[..., Any]
Records = Callable[..., list[Record]]

SMALL = ("--view-size", "32", "--map-size", "32")
RUN = ("run", "stairs", "cube-on-plane", "fence", "-t", "shadow-map", "-t", "cube-map", "--phases", "2", *SMALL)
STRESS = ("stress", "--quick", "-t", "cube-map:size=64", "--axis", "lamp-distance")
LIGHTS = "".join(f'{{ name = "{n}", kind = "directional", direction = [{n / 10}, -1, -0.5] }},' for n in range(12))
SCENE = f"""
camera = {{ position = [3, 2, 3], target = [0, 0, 0] }}
mesh = [{{ shape = "plane", scale = 8 }}, {{ shape = "box", translate = [0, 0.5, 0] }}]
light = [{LIGHTS}]
"""


def images_of(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")}


def by_key(rows: list[Record]) -> dict[str, Record]:
    """Rows by key, each of which there is once, without the command that made them."""
    keyed = {row["key"]: row for row in unsigned(rows)}
    assert len(keyed) == len(rows)
    return keyed


@pytest.mark.parametrize(
    ("command", "count"),
    [((*RUN, "--rounds", "0"), 2), (STRESS, 4)],
    ids=["run", "more parts than points"],
)
def test_merged_parts_equal_the_whole(
    shadowbench: Command, records: Records, tmp_path: Path, command: tuple[str, ...], count: int
) -> None:
    parts = [tmp_path / f"part-{number}" for number in range(1, count + 1)]
    for number, part in enumerate(parts, start=1):
        answer = shadowbench(*command, "--part", f"{number}/{count}", "-o", part)
        assert answer.code == 0, answer.err
        empty = f"note: --part {number}/{count}: nothing to measure, as the cells of a view stay together"
        assert bool(records(part)) != (empty in answer.err.splitlines())
    merged, whole = tmp_path / "merged", tmp_path / "whole"
    assert shadowbench(*command, "-o", whole).code == 0
    assert shadowbench("merge", *parts, "-o", merged).code == 0
    assert by_key(records(merged)) == by_key(records(whole))
    assert sum(len(records(part)) for part in parts) == len(records(whole)), "no cell is in two parts"
    assert images_of(merged) == images_of(whole)
    assert sorted(file.name for file in merged.glob("*.csv")) == sorted(file.name for file in whole.glob("*.csv"))


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """A scheduler with two workers like this process, and one of another version."""
    from distributed import Nanny, Scheduler, SpecCluster  # half a second, for slow tests alone

    preload = tmp_path_factory.mktemp("versions") / "other.py"
    preload.write_text("from shadowbench import versions\n\nversions.DRAW = 99\n")
    alike: dict[str, Any] = {"nthreads": 1, "silence_logs": logging.CRITICAL}
    other = alike | {"preload": [str(preload)]}
    workers = {index: {"cls": Nanny, "options": options} for index, options in enumerate((alike, alike, other))}
    scheduler = {"cls": Scheduler, "options": {"dashboard_address": ":0", "host": "127.0.0.1"}}
    with SpecCluster(workers, scheduler, silence_logs=logging.CRITICAL) as started:
        yield started


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        (*RUN, "-t", "half", "--rounds", "0", "--sequence", "quick-sun", "--frames", "3"),
        ("stress", "-t", "shadow-map", "--quick", "--axis", "gap", "--axis", "map-size"),
        ("recommend", "cube-on-plane", "--min-iou", "0.5", "--view-size", "48"),
    ],
    ids=["run", "stress", "recommend"],
)
def test_with_dask_rows_tables_and_images_are_the_same(
    shadowbench: Command, records: Records, cluster: Any, half: Path, tmp_path: Path, command: tuple[str, ...]
) -> None:
    """Also of a plug-in. A worker of another version is left out, once."""
    command = (*command, *(("--plugin", str(half)) if "half" in command else ()))
    on_dask = (*command, "-o", tmp_path / "dask", "--dask", cluster.scheduler_address)
    answers = [shadowbench(*on_dask), shadowbench(*command, "-o", tmp_path / "plain")]
    assert [answer.code for answer in answers] == [0, 0], answers
    assert answers[0].err.count("is left out: ") == answers[0].err.count("draw is 99 there, not ") == 1
    here = by_key(records(tmp_path / "plain"))
    assert by_key(records(tmp_path / "dask")) == here
    assert answers[0].out.replace("/dask", "/plain") == answers[1].out
    assert images_of(tmp_path / "dask") == images_of(tmp_path / "plain")
    assert shadowbench(*on_dask).out == answers[0].out
    assert len(records(tmp_path / "dask")) == len(here), "nothing is measured twice"


@pytest.fixture
def study(tmp_path: Path) -> list[str | Path]:
    """A study of as many blocks as lights, of seven cells each."""
    scene = tmp_path / "lights.toml"
    scene.write_text(SCENE)
    specs = ["-t", "unshadowed", "-t", "shadow-map", "-t", "shadow-map:bias=slope"]
    return ["run", scene, "--view-size", "96", "--rounds", "0", "--phases", "3", *specs, "-o", tmp_path / "out"]


@pytest.mark.slow
def test_blocks_of_a_killed_worker_are_measured_by_another(
    start: Any, records: Records, study: list[str | Path], tmp_path: Path
) -> None:
    run = start(*study, "--dask", "local:2")
    run.until(lambda: len(records(tmp_path / "out")) > 4)
    worker = next(one for one in run.family() if "spawn_main" in " ".join(one.cmdline()) and one.children())
    worker.kill()
    code, _, err = run.end()
    assert code == 0, err
    assert len(by_key(records(tmp_path / "out"))) == 12 * 7
    assert {row["status"] for row in records(tmp_path / "out")} == {"ok"}


@pytest.mark.slow
def test_ctrl_c_leaves_no_process(start: Any, records: Records, study: list[str | Path], tmp_path: Path) -> None:
    run = start(*study, "--dask", "local:2")
    run.until(lambda: len(records(tmp_path / "out")) > 4)
    family = run.family()
    assert len(family) >= 4  # two workers, and the processes that draw
    os.killpg(run.process.pid, signal.SIGINT)
    code, _, err = run.end()
    assert (code, "Traceback" in err) == (130, False)
    assert psutil.wait_procs(family, timeout=5)[1] == []


REFUSED = {
    "--dask local:0": "--dask local:0: allowed: local:N with N from 1 to 999, or a scheduler's address",
    "--dask local:2 --rounds 3": "--rounds 3: nothing is timed with --dask; allowed: 0",
    "--renderer llvmpipe": "--renderer: is for --dask, which is not given",
    "--dask tcp://127.0.0.1:9": "--dask tcp://127.0.0.1:9: no Dask scheduler answers",
    "--dask local:1 --renderer Matrox": "--dask: worker tcp",
}


@pytest.mark.parametrize("options", [
    pytest.param(options, marks=pytest.mark.slow) if "answers" in line or "tcp" in line else options
    for options, line in REFUSED.items()
])  # fmt: skip
def test_bad_options_are_one_line(shadowbench: Command, tmp_path: Path, options: str) -> None:
    answer = shadowbench("run", "cube-on-plane", *options.split(), "-q", "-o", tmp_path / "out")
    assert (answer.code, answer.err.count("\n")) == (2, 1), answer.err
    assert answer.err.startswith(f"shadowbench: {REFUSED[options]}")
    assert not (tmp_path / "out").exists()
