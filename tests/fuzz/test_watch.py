"""The fuzzer detects misbehaviour: stray reads and writes, excessive memory, tracebacks."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from shadowbench.errors import InputError

from . import command, verdict
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
    monkeypatch.setitem(verdict.READ, "scene", lambda case, main, assets: read(main) is None)
    found = judged(Case("scene", "a.toml", {"a.toml": b""}), WATCH)
    assert found.kind == "failure"
    assert line in found.line


@pytest.mark.parametrize(
    ("code", "said", "written", "line"),
    [
        (1, [], [], "exit code 1"),
        (0, ["Traceback (most recent call last):"], ["out/a.npz"], "a traceback"),
        (2, ["warning: x", "shadowbench: y"], [], "not one line"),
        (2, ["shadowbench: y", "note: x"], [], "not one line"),
        (2, ["shadowbench: y"], ["out/a.npz"], "left"),
        (0, [], ["out/.a.123.npz", "out/a.npz"], "wrote"),
        (0, [], [], "wrote only"),
        (2, ["note: x", "shadowbench: y"], [], ""),
        (0, ["note: x"], ["out/a.npz"], ""),
    ],
)
def test_a_command_that_misbehaves_is_a_failure(code: int, said: list[str], written: list[str], line: str) -> None:
    found = command.answer(code, said, {"out": 0}, {"out": 1, **dict.fromkeys(written, 1)})
    assert (found.kind == "failure") == bool(line)
    assert line in found.line
