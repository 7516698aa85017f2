"""Numbers of small cells, truths and scores change only with the version that keys have of them."""

import copy
import json
from typing import Any

import pytest

from .probes import FILE, KINDS, complaint, record

RECORDED = json.loads(FILE.read_text(encoding="utf-8"))


def test_numbers_change_only_with_the_version_of_what_makes_them() -> None:
    found = record()
    assert not "\n".join(complaint(kind, RECORDED, found) for kind in KINDS).strip()


@pytest.fixture
def found() -> dict[str, Any]:
    return copy.deepcopy(RECORDED)


@pytest.mark.parametrize("kind", KINDS)
def test_a_last_bit_is_noticed_on_the_processor_of_the_recording_alone(kind: str, found: dict[str, Any]) -> None:
    next(iter(found[kind].values()))["exact"] = "another"
    assert complaint(kind, RECORDED, found).startswith(f"{kind.upper()}: 1 of")
    found["identity"]["embree"] = "another processor"
    assert not complaint(kind, RECORDED, found)
