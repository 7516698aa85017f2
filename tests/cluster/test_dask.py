"""Measuring on Dask workers: the same rows as without, and one line for whatever is wrong with a cluster."""

import json
import sys
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from distributed.comm import CommClosedError

from shadowbench.cluster import cluster, connect, executor, workers
from shadowbench.cluster.parcel import PluginFiles, pack, unpack
from shadowbench.errors import InputError, NoGLError
from shadowbench.extremes.axes import AXES
from shadowbench.extremes.sweep import LineJob
from shadowbench.measure.cells import Block, Cell
from shadowbench.measure.measurer import BlockJob
from shadowbench.measure.timing import Conditions
from shadowbench.scenes.views import chosen_view
from shadowbench.techniques.registry import techniques
from shadowbench.techniques.spec import parse_spec
from tests.cluster.conftest import local_cluster

Records = Callable[..., list[dict[str, Any]]]
Command = Callable[..., Any]

SMALL = ["--view-size", "48", "--map-size", "64"]


@pytest.fixture
def compare(shadowbench: Command, records: Records, address: str, tmp_path: Path) -> Callable[..., None]:
    """Runs a command with and without --dask, which must write the same rows, tables and images."""

    def run(*arguments: str | Path) -> None:
        answers = [
            shadowbench(*arguments, "-o", tmp_path / "on-dask", "--dask", address),
            shadowbench(*arguments, "-o", tmp_path / "plain"),
        ]
        assert [answer.code for answer in answers] == [0, 0], answers
        there, here = (
            {row["key"]: {name: row[name] for name in row.keys() - {"command"}} for row in records(tmp_path / folder)}
            for folder in ("on-dask", "plain")
        )
        assert there == here
        assert len(records(tmp_path / "on-dask")) == len(here)
        assert answers[0].out.replace("on-dask", "plain") == answers[1].out
        images = [images_of(tmp_path / folder) for folder in ("on-dask", "plain")]
        assert images[0] == images[1]
        again = shadowbench(*arguments, "-o", tmp_path / "on-dask", "--dask", address)
        assert again.out == answers[0].out
        assert len(records(tmp_path / "on-dask")) == len(here)

    return run


def images_of(folder: Path) -> dict[str, bytes]:
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.png")}


def test_a_study_has_the_same_rows_and_images(compare: Callable[..., None], half: Path) -> None:
    specs = [argument for spec in ("shadow-map", "half", "shadow-map:bias=slope") for argument in ("-t", spec)]
    flags = ["--phases", "2", "--rounds", "0", "--step", "light", "--plugin", half]
    compare("run", "cube-on-plane", "spot-lamp", *specs, *SMALL, *flags)


def test_a_recommendation_is_the_same(compare: Callable[..., None]) -> None:
    compare("recommend", "cube-on-plane", "--min-iou", "0.5", "--view-size", "48")


@pytest.mark.slow
def test_a_sweep_has_the_same_rows(compare: Callable[..., None]) -> None:
    compare("stress", "-t", "shadow-map", "-t", "cube-map", "--quick", "--axis", "gap", "--axis", "map-size")


@pytest.mark.slow
def test_a_search_has_the_same_trials(compare: Callable[..., None]) -> None:
    scenes = ["--scenes", "cube-on-plane,spot-lamp", "--held-out", "spot-lamp"]
    compare("tune", "-t", "shadow-map", *scenes, "--trials", "3", "--phases", "1", *SMALL)


def test_rows_are_written_as_tasks_end_and_a_stopped_run_goes_on(
    shadowbench: Command, records: Records, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["run", "cube-on-plane", "spot-lamp", "-t", "unshadowed", *SMALL, "--rounds", "0", "-o", tmp_path]
    keep, kept = executor._keep, []

    def stopped(*given: Any) -> Any:
        if kept:
            raise KeyboardInterrupt
        kept.append(keep(*given))
        return kept[-1]

    with monkeypatch.context() as patch:
        patch.setattr(executor, "_keep", lambda outcome, bench: (stopped if outcome.rows else keep)(outcome, bench))
        assert shadowbench(*arguments, "--dask", address).code == 130
    first = records(tmp_path)
    assert len(first) == 1
    assert shadowbench(*arguments, "--dask", address).code == 0
    assert records(tmp_path)[:1] == first
    assert len(records(tmp_path)) == 2


@pytest.fixture
def lost(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Loses the connection to the scheduler once, while a result is gathered for the n-th time, one after the other."""
    gather, gathered = Client.gather, count(1)

    def lose(at: int) -> None:
        def lossy(client: Client, futures: Any, **options: Any) -> Any:
            if futures and next(gathered) == at:
                raise CommClosedError("in <TCP (closed)>: Connection reset by peer")
            return gather(client, futures, **options)

        monkeypatch.setattr(executor, "_MOST_AT_ONCE", 1)
        monkeypatch.setattr(Client, "gather", lossy)

    return lose


LOST = ["run", "cube-on-plane", "spot-lamp", "-t", "unshadowed", *SMALL, "--rounds", "0"]


def test_a_scheduler_lost_while_results_are_gathered_loses_no_row(
    shadowbench: Command, records: Records, address: str, tmp_path: Path, lost: Callable[[int], None]
) -> None:
    lost(3)  # after two truths
    answer = shadowbench(*LOST, "--dask", address, "-o", tmp_path)
    assert answer.code == 0, answer.err
    assert len({row["key"] for row in records(tmp_path)}) == len(records(tmp_path)) == 2


def test_a_scheduler_that_stays_away_is_one_line_and_the_rows_are_kept(
    shadowbench: Command,
    records: Records,
    address: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    lost: Callable[[int], None],
) -> None:
    with monkeypatch.context() as patch:
        answers, connected = iter([True]), connect.Connection._connect

        def once(connection: connect.Connection) -> Client:
            if next(answers, False):
                return connected(connection)
            raise InputError("no Dask scheduler answers")

        patch.setattr(connect.Connection, "_connect", once)
        patch.setattr(connect, "WORKERS_S", 0.0)
        lost(4)
        answer = shadowbench(*LOST, "--dask", address, "-q", "-o", tmp_path)
    line = "the scheduler has gone; what was measured is kept, and the same command goes on"
    assert (answer.code, answer.err) == (3, f"shadowbench: --dask {address}: {line}\n")
    first = records(tmp_path)
    assert len(first) == 1
    assert shadowbench(*LOST, "--dask", address, "-o", tmp_path).code == 0
    assert len(records(tmp_path)) == 2 and records(tmp_path)[:1] == first


def test_times_are_taken_where_asked_and_nowhere_else(
    shadowbench: Command, records: Records, address: str, tmp_path: Path
) -> None:
    study = tmp_path / "study.toml"
    study.write_text('scenes = ["cube-on-plane"]\nrounds = 2\nview_size = 48\ntechnique = [{spec = "unshadowed"}]\n')
    arguments = ["run", "-s", study, "--dask", address, "-o", tmp_path / "out"]
    untimed = shadowbench(*arguments)
    assert (untimed.code, records(tmp_path / "out", "time")) == (0, []), untimed.err
    assert "note: nothing is timed: --time-on says on which machine" in untimed.err
    assert shadowbench(*arguments, "--time-on", "each").code == 0
    (row,) = records(tmp_path / "out", "time")
    assert row["machine"] == json.loads((tmp_path / "out" / "run.json").read_text())["machine_key"]
    assert len(records(tmp_path / "out", "score")) == 1
    here = shadowbench(*arguments, "--time-on", "here")
    assert (here.code, len(records(tmp_path / "out", "time"))) == (0, 1), here.err  # the same machine


REFUSED = {
    "no workers at all": (["--dask", "local:0"], "--dask local:0: allowed: local:N with N from 1 to 256"),
    "no number of workers": (["--dask", "local"], "--dask local: allowed: local:N with N from 1 to 256"),
    "rounds without a place": (
        ["--dask", "local:2", "--rounds", "3"],
        "--rounds 3 with --dask: times belong to one machine; allowed: --rounds 0, or --time-on here, each or a worker",
    ),
    "a place without rounds": (
        ["--dask", "local:2", "--rounds", "0", "--time-on", "here"],
        "--time-on here: found 0 rounds; allowed: 1 or more",
    ),
    "a place without Dask": (["--time-on", "here"], "--time-on: is for --dask, which is not given"),
    "a renderer without Dask": (["--renderer", "llvmpipe"], "--renderer: is for --dask, which is not given"),
    "a profile": (["--dask", "local:2", "--profile"], "--profile: measures this process; allowed: without --dask"),
    "an address of nobody": (["--dask", "tcp://127.0.0.1:9"], "--dask tcp://127.0.0.1:9: no Dask scheduler answers"),
    "TLS without a certificate": (
        ["--dask", "tls://127.0.0.1:9"],
        "--dask tls://127.0.0.1:9: no Dask scheduler answers",
    ),
    "an empty address": (["--dask", ""], "--dask : no Dask scheduler answers"),
    "no address": (["--dask", "no address"], "--dask no address: no Dask scheduler answers"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_bad_options_are_one_line(
    what: str, shadowbench: Command, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connect, "CONNECT_S", 0.5)
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


@pytest.fixture
def refusal(shadowbench: Command, address: str, tmp_path: Path) -> Callable[..., str]:
    """The line of a run that the cluster refuses."""

    def run(*options: str) -> str:
        given = options if "--dask" in options else (*options, "--dask", address)
        answer = shadowbench("run", "cube-on-plane", *SMALL, "--rounds", "0", "-q", *given, "-o", tmp_path)
        assert answer.code == 2
        assert answer.err.count("\n") == 1
        return str(answer.err)

    return run


def test_a_cluster_without_workers_is_refused_after_a_time(
    refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "WORKERS_S", 0.5)
    with local_cluster(0) as empty:
        assert "no worker within 0.5 s" in refusal("--dask", empty.scheduler_address)


def test_workers_of_another_version_are_refused(refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    found = workers.own_versions()
    versions = iter([found | {"numpy": "1.0"}])
    monkeypatch.setattr(workers, "own_versions", lambda: next(versions, found))
    assert "no worker can measure; tcp://" in (line := refusal())
    assert f"numpy is {found['numpy']} there and 1.0 here (and 1 more)" in line


def test_workers_without_gl_are_refused(refusal: Callable[..., str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "station", no_device)
    assert "no worker can measure" in (line := refusal())
    assert "no OpenGL here" in line


def no_device(setup: object) -> None:
    raise NoGLError("no OpenGL here")


def test_workers_of_another_renderer_are_refused(refusal: Callable[..., str]) -> None:
    assert "that of the study Matrox Millennium" in refusal("--renderer", "Matrox Millennium")


def test_a_plug_in_by_value_has_the_same_keys(half: Path, tmp_path: Path) -> None:
    (tmp_path / "one" / "deep").mkdir(parents=True)
    file = tmp_path / "one" / "half.py"
    file.write_bytes(half.read_bytes())
    shader = tmp_path / "one" / "deep" / "half.frag"
    shader.write_text("void main() {}")
    view = chosen_view("cube-on-plane", 32)
    job = BlockJob(Block(view, (Cell(parse_spec("half", techniques([file]))),)), Conditions())
    keys = job.keys({"renderer": "r"})
    data, scenes = pack(job)
    assert scenes == [view.scene]
    assert len(data) < 10_000
    copy = PluginFiles.of(file).write(tmp_path / "two")
    assert copy != file
    shader.unlink()
    again = unpack(data, scenes, techniques([copy]))
    assert again.block.view.scene is view.scene
    assert list(again.keys({"renderer": "r"}).values()) == list(keys.values())


def test_an_axis_s_job_is_picklable() -> None:
    specs = (parse_spec("shadow-map:bias=slope", techniques()),)
    for axis in AXES.values():
        job = LineJob(axis, axis.lights[0], axis.swept(True), specs)
        again = unpack(*pack(job), techniques())
        assert (again.axis.name, again.values, again.specs) == (axis.name, job.values, specs)


def test_a_recommendation_is_timed_on_one_worker(shadowbench: Command, address: str, tmp_path: Path) -> None:
    answer = shadowbench("recommend", "cube-on-plane", "--time-on", "each", "--dask", address, "-o", tmp_path, "-q")
    line = "shadowbench: --time-on each: allowed: one worker, by its address or machine\n"
    assert (answer.code, answer.err) == (2, line)
    budget = shadowbench("recommend", "cube-on-plane", "--budget-ms", "2", "--dask", address, "-o", tmp_path, "-q")
    assert (budget.code, "nothing is timed with --dask" in budget.err) == (2, True)


def test_a_worker_takes_times_only_when_its_machine_is_idle(
    shadowbench: Command, records: Records, address: str, tmp_path: Path
) -> None:
    arguments = ["run", "cube-on-plane", "-t", "unshadowed", *SMALL, "--rounds", "1", "--time-on", "each"]
    with Client(address, set_as_default=False) as other:
        busy = other.submit(time.sleep, 3.0)
        ends = time.monotonic() + 2.5
        assert shadowbench(*arguments, "--dask", address, "-o", tmp_path).code == 0
        assert busy.done()
        assert time.monotonic() > ends
    assert len(records(tmp_path, "time")) == 1
