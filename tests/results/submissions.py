"""A submission of the whole study that nothing speaks against, and changes of it."""

from collections.abc import Sequence
from typing import Any

import pandas as pd

from shadowbench.gl.clock import QUERIES
from shadowbench.results.submission import Noise, Submission, TimedCell, counted_work


def submission() -> Submission:
    """Each cell of the study takes a millisecond."""
    times: dict[str, Any] = {"clock": QUERIES, "n": 9, "frame_ms": 1.2, "added_ms": 1.0, "ratio": 1.0, "ratio_iqr": 0.1}
    cells = [
        TimedCell(
            scene=row["scene"],
            light=row["light"],
            spec=row["spec"],
            map_size=None if pd.isna(row["map_size"]) else int(row["map_size"]),
            iou=row["iou"],
            gpu_bytes=row["gpu_bytes"],
            **times,
        )
        for row in counted_work().to_dict("records")
    ]
    return Submission(
        format=1,
        device="Some GPU",
        renderer="Some GPU, 4.6",
        vendor="Some",
        software=False,
        clocks=None,
        noise=Noise(ratio=1.01, worst=1.02, n=45),
        machine={"processor": "some"},
        versions={"shadowbench": "0"},
        finished="2026-01-01T00:00:00+00:00",
        view_size=1024,
        reference="shadow-map:size=1024",
        cells=tuple(cells),
    )


def changed(one: Submission, **columns: Sequence[Any]) -> Submission:
    """With other values of fields of its cells, one for each."""
    rows = zip(one.cells, *columns.values(), strict=True)
    return one.model_copy(
        update={"cells": tuple(cell.model_copy(update=dict(zip(columns, row, strict=True))) for cell, *row in rows)}
    )
