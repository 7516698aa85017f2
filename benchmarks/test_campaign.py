"""Where the seconds of a campaign go, its truths being cached: `pytest benchmarks/test_campaign.py -rP`.

Of scored cells: drawing is a call to the worker until its answer is read, the truth is read from the cache while the
first cell is scored, and in what waits nothing of the four runs. Parts that run beside each other add up to more.
"""

import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from shadowbench.measure.campaign import Campaign, LogReporter
from shadowbench.measure.frames import CellScores
from shadowbench.measure.gl_drawer import GLDrawer, campaign_in
from shadowbench.measure.pictures import Pictures
from shadowbench.measure.rows import RowStore
from shadowbench.measure.worker import Pipe, Worker
from shadowbench.plugin.registry import techniques
from shadowbench.studies.run import measure
from shadowbench.studies.study import find_study, read_study

CALLS = {Campaign: ("_score", "_time"), GLDrawer: ("_measure",), Worker: ("call",), Pipe: ("receive",)}
SCORES = {CellScores: ("add", "record")}
WRITES = {Pictures: ("write_cell", "write_truth", "write_shading"), RowStore: ("append",)}


def covered(*spans: tuple[float, float]) -> float:
    """Seconds in at least one of the spans."""
    seconds, end = 0.0, 0.0
    for first, last in sorted(spans):
        seconds, end = seconds + max(last - max(first, end), 0.0), max(end, last)
    return seconds


@pytest.mark.benchmark(group="campaign")
@pytest.mark.parametrize("views", [1, 24])
def test_demo(
    tmp_path: Path, smallest: bool, monkeypatch: pytest.MonkeyPatch, benchmark: BenchmarkFixture, views: int
) -> None:
    """Of single views, and of the frames of a sequence, whose truths are traced meanwhile."""
    spans, frames = defaultdict[str, list[tuple[float, float]]](list), list[tuple[float, float, float]]()

    def noted(name: str, call: Callable[..., Any]) -> Callable[..., Any]:
        def note(*arguments: Any, **options: Any) -> Any:
            start = time.perf_counter()
            result = call(*arguments, **options)
            spans[name].append(span := (start, time.perf_counter()))
            if name == "call" and arguments[1].__name__ in ("time_frame", "time_passes"):
                ms = result.wall_ms if arguments[1].__name__ == "time_frame" else sum(result.ms.values())
                frames.append((*span, ms / 1e3))
            return result

        return note

    study = read_study(find_study("demo"), techniques()).with_(
        **({"sequence": "pan", "frames": views} if views > 1 else {})
    )
    if smallest:
        study = study.with_(scenes=study.scenes[:1], technique=study.technique[:3], map_size=None, view_size=64)
    with Worker() as worker, campaign_in(tmp_path / "run", LogReporter(), worker=worker) as campaign:
        campaign.trace([*study.blocks()])
        for owner, names in (CALLS | SCORES | WRITES).items():
            for name in names:
                monkeypatch.setattr(owner, name, noted(name, getattr(owner, name)))
        benchmark.pedantic(measure, args=(study, campaign), rounds=1)

    def scored(*names: str) -> list[tuple[float, float]]:
        inside = [span for name in names for span in spans[name]]
        return [span for span in inside if any(start <= span[0] <= end for start, end in spans["_score"])]

    whole, drawn, read = (covered(*scored(name)) for name in ("_score", "call", "receive"))
    writes = [name for names in WRITES.values() for name in names]
    rounds = [[frame for frame in frames if start <= frame[0] <= end] for start, end in spans["_measure"]]
    rounds_s, frames_s = sum(group[-1][1] - group[0][0] for group in rounds), sum(frame[2] for frame in frames)
    seconds = {"scored cells": whole, "of a view": whole / views, "drawing": drawn - read, "reading back": read}
    seconds |= {"scoring": covered(*scored("add", "record")), "writing": covered(*scored(*writes))}
    seconds["waiting"] = whole - covered(*scored("call", "add", "record", *writes))
    seconds |= {"timed cells": covered(*spans["_time"]), "their rounds": rounds_s, "their frames": frames_s}
    either = (covered(*scored("call", "add", "record")) - read) / whole
    shares = {"drawing or scoring": either, "frames in rounds": frames_s / rounds_s}
    benchmark.extra_info |= {**seconds, **shares, "rows": len(campaign.store.scores)}
    print(*(f"{name}: {value:.2f}" for name, value in (seconds | shares).items()), sep="\n")
