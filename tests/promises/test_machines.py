"""Several machines, by `--part` and `merge` or by `--dask`, give the rows, images and tables of one."""

import json
import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from distributed import Client

from tests.promises.conftest import Record, unsigned
from tests.promises.test_lost_machines import Processes, kill

Command = Callable[..., Any]
Records = Callable[..., list[Record]]

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")

SMALL = ["--view-size", "48", "--map-size", "64"]
PARTED = (
    "stairs",
    "cube-on-plane",
    "fence",
    "-t",
    "shadow-map",
    "-t",
    "cube-map",
    "-t",
    "unshadowed",
    "--map-size",
    "32,64",
)
RUN = ("run", *PARTED, "--phases", "2", "--view-size", "32", "--rounds", "0", "-q")
STRESS = ("stress", "--quick", "-t", "shadow-map:size=64", "-t", "cube-map:size=64", "--axis", "gap", "-q")
ONE_VIEW = ("run", "cube-on-plane", "-t", "unshadowed", "-t", "cube-map", *SMALL, "--rounds", "0")
STRESS_FEW = ("stress", "--quick", "-t", "cube-map:size=64", "--axis", "lamp-distance")
EMPTY = "note: --part {}: nothing to measure, as the cells of a view stay together"


def images_of(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")}


def by_key(rows: list[Record]) -> dict[str, Record]:
    """Rows by key, each of which there is once, without the command that made them."""
    found = {row["key"]: row for row in unsigned(rows)}
    assert len(found) == len(rows)
    return found


@pytest.mark.parametrize(
    ("command", "count"),
    [(RUN, 2), (ONE_VIEW, 2), pytest.param(STRESS, 2, marks=pytest.mark.slow), (STRESS_FEW, 4)],
    ids=["run", "more parts than views", "stress", "more parts than points"],
)
def test_merged_parts_equal_the_whole(
    shadowbench: Command, records: Records, tmp_path: Path, command: tuple[str, ...], count: int
) -> None:
    parts = [tmp_path / f"part-{number}" for number in range(1, count + 1)]
    for number, part in enumerate(parts, start=1):
        answer = shadowbench(*command, "--part", f"{number}/{count}", "-o", part)
        assert answer.code == 0, answer.err
        assert {"rows.jsonl", "run.json", "table.csv"} <= {file.name for file in part.iterdir()}
        assert bool(records(part)) != (EMPTY.format(f"{number}/{count}") in answer.err.splitlines())
    assert any(map(records, parts)) and ("-q" in command) == all(map(records, parts))
    assert shadowbench(*command, "-o", tmp_path / "whole").code == 0
    assert shadowbench("merge", *parts, "-o", tmp_path / "merged").code == 0
    merged, whole = tmp_path / "merged", tmp_path / "whole"
    assert by_key(records(merged)) == by_key(records(whole))
    assert sum(len(records(part)) for part in parts) == len(records(whole)), "no cell is in two parts"
    assert images_of(merged) == images_of(whole)
    assert sorted(file.name for file in merged.glob("*.csv")) == sorted(file.name for file in whole.glob("*.csv"))


@pytest.fixture(scope="module")
def processes(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Processes]:
    with ExitStack() as stack:
        yield Processes(stack, tmp_path_factory.mktemp("dask"))


@pytest.fixture(scope="module")
def address(processes: Processes) -> str:
    """Address of a scheduler with two workers."""
    processes.wait_for(2)
    return processes.address


@pytest.fixture
def compare(shadowbench: Command, records: Records, address: str, tmp_path: Path) -> Callable[..., None]:
    """Runs a command with and without --dask, which must write the same rows, tables and images."""

    def run(*arguments: str | Path) -> None:
        on_dask = (*arguments, "-o", tmp_path / "on-dask", "--dask", address)
        answers = [shadowbench(*on_dask), shadowbench(*arguments, "-o", tmp_path / "plain")]
        assert [answer.code for answer in answers] == [0, 0], answers
        here = by_key(records(tmp_path / "plain"))
        assert by_key(records(tmp_path / "on-dask")) == here
        assert answers[0].out.replace("on-dask", "plain") == answers[1].out
        assert images_of(tmp_path / "on-dask") == images_of(tmp_path / "plain")
        assert shadowbench(*on_dask).out == answers[0].out
        assert len(records(tmp_path / "on-dask")) == len(here), "nothing is measured twice"

    return run


@pytest.mark.slow
def test_a_study_has_the_same_rows_and_images(compare: Callable[..., None], half: Path, tmp_path: Path) -> None:
    """Also those of a plug-in, whose files are sent."""
    shader = tmp_path / "plug-in" / "deep" / "half.frag"
    shader.parent.mkdir(parents=True)
    text, _, rest = half.read_text().partition('SHADER = """')
    inline, _, rest = rest.partition('"""')
    shader.write_text(inline)
    plugin = tmp_path / "plug-in" / "half.py"
    plugin.write_text(f'{text}from pathlib import Path\n\nSHADER = Path(__file__).parent / "deep" / "half.frag"{rest}')
    specs = [argument for spec in ("shadow-map", "half", "shadow-map:bias=slope") for argument in ("-t", spec)]
    flags = ["--phases", "2", "--rounds", "0", "--step", "light", "--plugin", plugin]
    compare("run", "cube-on-plane", "spot-lamp", *specs, *SMALL, *flags)


@pytest.mark.slow
def test_a_recommendation_is_the_same(compare: Callable[..., None]) -> None:
    compare("recommend", "cube-on-plane", "--min-iou", "0.5", "--view-size", "48")


@pytest.mark.slow
def test_a_sweep_has_the_same_rows(compare: Callable[..., None]) -> None:
    compare("stress", "-t", "shadow-map", "-t", "cube-map", "--quick", "--axis", "gap", "--axis", "map-size")


@pytest.mark.slow
def test_times_are_taken_where_asked_and_nowhere_else(
    shadowbench: Command, records: Records, address: str, tmp_path: Path
) -> None:
    out, study = tmp_path / "out", tmp_path / "study.toml"
    study.write_text('scenes = ["cube-on-plane"]\nrounds = 2\nview_size = 48\ntechnique = [{spec = "unshadowed"}]\n')
    arguments = ["run", "-s", study, "--dask", address, "-o", out]
    untimed = shadowbench(*arguments)
    assert (untimed.code, records(out, "time")) == (0, []), untimed.err
    assert "note: nothing is timed: --time-on says on which machine" in untimed.err
    here = shadowbench(*arguments, "--time-on", "here")
    assert here.code == 0, here.err
    (row,) = records(out, "time")
    assert row["machine"] == json.loads((out / "run.json").read_text())["machine_key"]
    assert len(records(out, "score")) == 1


@pytest.mark.slow
def test_a_worker_takes_times_only_when_its_machine_is_idle(
    shadowbench: Command, records: Records, address: str, tmp_path: Path
) -> None:
    with Client(address, set_as_default=False) as other:
        (worker, *_) = other.scheduler_info(n_workers=-1)["workers"]
        arguments = ["run", "cube-on-plane", "-t", "unshadowed", *SMALL, "--rounds", "1", "--time-on", worker]
        busy = other.submit(time.sleep, 6.0, workers=[worker])
        ends = time.monotonic() + 5.5
        answer = shadowbench(*arguments, "--dask", address, "-o", tmp_path)
        assert answer.code == 0, answer.err
        assert busy.done()
        assert time.monotonic() > ends
    assert len(records(tmp_path, "time")) == 1


REFUSED = {
    "no workers at all": (["--dask", "local:0"], "--dask local:0: allowed: local:N with N from 1 to 256"),
    "no number of workers": (["--dask", "local"], "--dask local: allowed: local:N with N from 1 to 256"),
    "rounds without a place": (
        ["--dask", "local:2", "--rounds", "3"],
        "--rounds 3 with --dask: times belong to one machine; allowed: --rounds 0, or --time-on here",
    ),
    "a place without rounds": (
        ["--dask", "local:2", "--rounds", "0", "--time-on", "here"],
        "--time-on here: found 0 rounds; allowed: 1 or more",
    ),
    "a place without Dask": (["--time-on", "here"], "--time-on: is for --dask, which is not given"),
    "a renderer without Dask": (["--renderer", "llvmpipe"], "--renderer: is for --dask, which is not given"),
    "an empty address": (["--dask", ""], "--dask : no Dask scheduler answers"),
    "no address": (["--dask", "no address"], "--dask no address: no Dask scheduler answers"),
    "an address of nobody": (["--dask", "tcp://127.0.0.1:9"], "--dask tcp://127.0.0.1:9: no Dask scheduler answers"),
    "TLS without a certificate": (
        ["--dask", "tls://127.0.0.1:9"],
        "--dask tls://127.0.0.1:9: no Dask scheduler answers",
    ),
}


@pytest.mark.parametrize("what", [
    pytest.param(what, marks=pytest.mark.slow) if "answers" in line else what for what, (_, line) in REFUSED.items()
])  # fmt: skip
def test_bad_options_are_one_line(shadowbench: Command, tmp_path: Path, what: str) -> None:
    options, line = REFUSED[what]
    answer = shadowbench("run", "cube-on-plane", *options, "-q", "-o", tmp_path / "out")
    assert answer.code == 2
    assert answer.err.startswith(f"shadowbench: {line}")
    assert answer.err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_the_extra_a_line_says_what_to_install(shadowbench: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    answer = shadowbench("stress", "--dask", "local:2", "-q")
    assert (answer.code, answer.err) == (
        2,
        "shadowbench: --dask needs Dask; pip install '.[dask]' in a checkout of shadowbench installs it\n",
    )


@pytest.mark.slow
def test_a_recommendation_by_time_needs_a_place_to_time_on(shadowbench: Command, address: str, tmp_path: Path) -> None:
    timed = shadowbench("recommend", "cube-on-plane", "--by", "time", "--dask", address, "-o", tmp_path, "-q")
    assert (timed.code, "nothing is timed with --dask" in timed.err) == (2, True)


@pytest.mark.slow
def test_workers_of_another_renderer_without_gl_or_of_another_version_are_refused(
    shadowbench: Command, tmp_path: Path
) -> None:
    information = tmp_path / "versions" / "trimesh-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: trimesh\nVersion: 1.0\n")
    with ExitStack() as stack:
        processes = Processes(stack, tmp_path / "dask")
        processes.wait_for(2)

        def refusal(*options: str) -> str:
            words = ("run", "cube-on-plane", *SMALL, "--rounds", "0", "-q", *options)
            answer = shadowbench(*words, "--dask", processes.address, "-o", tmp_path / "out")
            assert answer.code == 2 and answer.err.count("\n") == 1
            return str(answer.err)

        assert "that of the study Matrox Millennium" in refusal("--renderer", "Matrox Millennium")
        for environment, said in (
            ({"__EGL_VENDOR_LIBRARY_FILENAMES": str(tmp_path / "none.json")}, "no OpenGL 4.1 context"),
            ({"PYTHONPATH": os.pathsep.join([str(tmp_path / "versions"), *sys.path])}, "trimesh is 1.0 there and "),
        ):
            for worker in processes.workers:
                kill(worker)
            processes.workers = [processes.start_worker(**environment)]
            processes.wait_for(1)
            line = refusal()
            assert "no worker can measure" in line and said in line


@pytest.mark.slow
def test_a_cluster_without_workers_or_whose_scheduler_stays_away_is_one_line(
    start: Any, records: Records, tmp_path: Path
) -> None:
    """Either is waited for; what was measured is kept, and the same command goes on."""
    specs = [word for spec in ("unshadowed", "shadow-map", "shadow-map:filter=pcf") for word in ("-t", spec)]
    study = ["run", "cube-on-plane", "spot-lamp", *specs, "--view-size", "96", "--rounds", "0", "--phases", "8", "-q"]
    with ExitStack() as stack:
        empty, gone = (Processes(stack, tmp_path / name) for name in ("empty", "gone"))
        for worker in empty.workers:
            kill(worker)
        waiting = start(*study, "--dask", empty.address, "-o", tmp_path / "none")
        lost = start(*study, "--dask", gone.address, "-o", tmp_path / "out")
        lost.until(lambda: len(records(tmp_path / "out")) > 1)
        kill(gone.scheduler)
        code, _, err = lost.end()
        line = "the scheduler has gone; what was measured is kept, and the same command goes on"
        assert (code, err) == (3, f"shadowbench: --dask {gone.address}: {line}\n")
        code, _, err = waiting.end()
        assert code == 2 and "no worker within 60 s" in err and err.count("\n") == 1
    first = records(tmp_path / "out")
    code, _, err = start(*study, "-o", tmp_path / "out").end()
    assert code == 0, err
    rows = records(tmp_path / "out")
    assert rows[: len(first)] == first and len(by_key(rows)) == len(rows) == 2 * (1 + 2 * 8)
