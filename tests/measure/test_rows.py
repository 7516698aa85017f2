"""The lock of a run folder, in the moment when its file is removed."""

import sys
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError
from shadowbench.measure.row_store import RowStore
from shadowbench.scores.metrics import METRICS
from tests.conftest import key_of

SCORE = {
    "kind": "score", "key": key_of("a"), "scene": "s", "view": "camera", "light": "sun", "phase": 0,
    "technique": "unshadowed", "spec": "unshadowed", "full_spec": "unshadowed", "map_size": None, "view_size": 16,
    "coordinates": "relative", "renderer": "r", "status": "ok", "metrics": dict.fromkeys(METRICS, 0.5), "receivers": 9,
    "undecided": 1, "gpu_bytes": 100, "work": {"draws": 1}, "facts": {}, "assumptions": [],
}  # fmt: skip


@pytest.mark.skipif(sys.platform == "win32", reason="an open file cannot be removed there")
def test_a_process_that_opened_a_lock_before_its_release_does_not_write_with_the_next_owner(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first, holders = RowStore(tmp_path), []
    import fcntl

    lock = fcntl.flock

    def late(file: Any, operation: int) -> None:
        """Delays the second process's lock until the first has released the file and a third has locked a new one."""
        monkeypatch.setattr(fcntl, "flock", lock)
        first.close()
        holders.append(RowStore(tmp_path))
        lock(file, operation)

    monkeypatch.setattr(fcntl, "flock", late)
    with pytest.raises(InputError, match="another run writes into it"):
        RowStore(tmp_path)
    (third,) = holders
    third.append(SCORE)
    third.close()
    RowStore(tmp_path).close()
