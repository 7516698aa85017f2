"""The fuzzer detects misbehaviour: stray reads and writes, excessive memory, tracebacks."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError

from . import verdict
from .cases import Case
from .verdict import MOST_MEMORY, Watch, judged

WATCH = Watch()  # a hook stays for the life of the process


def refuse(line: str, cause: Exception | None = None) -> None:
    raise InputError(line) from cause


@pytest.mark.parametrize(
    ("read", "line"),
    [
        (lambda main: (main.parents[1] / "outside" / "part.obj").read_bytes(), "read ./outside/part.obj"),
        (lambda main: main.with_name("new").write_bytes(b"x"), "wrote ./inside/new"),
        (lambda main: os.mkfifo(main.with_name("new")), "something was written"),
        (lambda main: int("x"), "ValueError: invalid literal"),
        (lambda main: refuse("too large", MemoryError()), "memory: too large"),
        (lambda main: bytearray(2 * MOST_MEMORY), "MemoryError"),
        (lambda main: refuse("x" * 5000), "a line of 5000 characters"),
    ],
    ids=["reads elsewhere", "writes", "leaves a pipe", "raises", "has no memory", "takes much memory", "talks much"],
)
def test_a_reader_that_misbehaves_is_a_failure(
    monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], Any], line: str
) -> None:
    monkeypatch.setitem(verdict.READ, "scene", lambda case, main, assets: read(main))
    found = judged(Case("scene", "a.toml", {"a.toml": b""}), WATCH)
    assert found.kind == "failure"
    assert line in found.line
