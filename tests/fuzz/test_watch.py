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
CASE = Case("scene", "a.toml", {"a.toml": b""})


def no_memory() -> None:
    try:
        raise MemoryError
    except MemoryError as error:
        raise InputError("too large") from error


@pytest.mark.parametrize(
    ("read", "line"),
    [
        (lambda main: (main.parents[1] / "outside" / "part.obj").read_bytes(), "read ./outside/part.obj"),
        (lambda main: main.with_name("new").write_bytes(b"x"), "wrote ./inside/new"),
        (lambda main: os.mkfifo(main.with_name("new")), "something was written"),
        (lambda main: int("x"), "ValueError: invalid literal"),
        (lambda main: no_memory(), "memory: too large"),
        (lambda main: bytearray(2 * MOST_MEMORY), "MemoryError"),
        (lambda main: (_ for _ in ()).throw(InputError("x" * 5000)), "a line of 5000 characters"),
    ],
    ids=[
        "reads elsewhere",
        "writes",
        "leaves a pipe",
        "raises",
        "has no memory",
        "takes too much memory",
        "talks too much",
    ],
)
def test_a_reader_that_misbehaves_is_a_failure(
    monkeypatch: pytest.MonkeyPatch, read: Callable[[Path], Any], line: str
) -> None:
    def reader(case: Case, main: Path, assets: Path) -> bool:
        read(main)
        return True

    monkeypatch.setitem(verdict.READ, "scene", reader)
    found = judged(CASE, WATCH)
    assert found.kind == "failure"
    assert line in found.line


@pytest.mark.parametrize(
    ("code", "said", "memory", "written", "line"),
    [
        (1, [], 0, [], "exit code 1"),
        (0, ["Traceback (most recent call last):"], 0, ["out/a.npz"], "a traceback"),
        (2, ["x", "shadowbench: y"], 0, [], "2 lines"),
        (2, ["warning: x", "shadowbench: y"], 0, [], "2 lines"),
        (2, ["shadowbench: x", "note: a", "shadowbench: y"], 0, [], "2 lines"),
        (2, ["note: x", "  and more", "shadowbench: y"], 0, [], "2 lines"),
        (2, ["shadowbench: y", "note: x"], 0, [], "a note after the error"),
        (2, ["note: x"], 0, [], "0 lines"),
        (2, [], 0, [], "0 lines"),
        (2, ["error"], 0, [], "no line of ours"),
        (2, ["shadowbench: y"], 0, ["out/a.npz"], "left"),
        (0, [], 0, ["out/.a.123.npz", "out/a.npz"], "half-written"),
        (0, [], 0, ["inside/b"], "wrote"),
        (0, [], 0, [], "wrote only"),
        (0, [], 5 << 30, ["out/a.npz"], "5.0 GiB"),
    ],
)
def test_a_command_that_misbehaves_is_a_failure(
    code: int, said: list[str], memory: int, written: list[str], line: str
) -> None:
    found = command.answer(code, said, memory, 1.0, {"out": 0}, {"out": 1, **dict.fromkeys(written, 1)})
    assert found.kind == "failure"
    assert line in found.line


def test_a_correct_command_is_no_finding() -> None:
    for said in (["shadowbench: y"], ["note: x", "note: z", "shadowbench: y"]):
        assert command.answer(2, said, 0, 1.0, {"out": 0}, {"out": 0}) == ("refusal", "shadowbench: y", True)
    assert command.answer(0, ["note: x"], 0, 1.0, {"out": 0}, {"out": 1, "out/a.npz": 1}).kind == "result"
