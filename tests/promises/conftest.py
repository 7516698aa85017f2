"""Runs of small studies as a user starts them, and what they leave in their folders and among the processes.

Nothing here or in the tests beside it knows how the package measures.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest

Record = dict[str, Any]

STUDY = """
scenes = ["cube-on-plane"]
view_size = 64
rounds = 1
memory_limit = 1
reference = "unshadowed"
"""


def study_text(*specs: str, **fields: object) -> str:
    """A study file of a small view; fields replace those of STUDY, and are written as TOML has them."""
    lines = [line for line in STUDY.strip().splitlines() if line.split()[0] not in fields]
    lines += [f"{name} = {value}" for name, value in fields.items()]
    return "\n".join([*lines, *(f'[[technique]]\nspec = "{spec}"' for spec in specs), ""])


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "table.csv").open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def by_spec(folder: Path) -> dict[str, dict[str, str]]:
    """The lines of table.csv by spec, with the map size behind it where there is one."""
    return {":".join(filter(None, (line["spec"], line["map_size"]))): line for line in table(folder)}


def unsigned(rows: list[Record]) -> list[Record]:
    """Rows without the command that made them."""
    return [{name: value for name, value in row.items() if name != "command"} for row in rows]


def finished(*words: str | Path, **options: Any) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own, until it ends."""
    command = [sys.executable, "-m", "shadowbench", *map(str, words)]
    options = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True, "timeout": 240} | options
    return subprocess.run(command, check=False, **options)


def gone(processes: list[psutil.Process]) -> bool:
    """Whether processes end soon."""
    return psutil.wait_procs(processes, timeout=30)[1] == []


def marked(name: str, value: Path) -> list[psutil.Process]:
    """Processes with this variable in their environment, whatever their parent, but for this one."""
    found = []
    for process in psutil.process_iter():
        try:
            if process.pid != os.getpid() and process.environ().get(name) == str(value):
                found.append(process)
        except psutil.Error:
            continue
    return found


@dataclass
class Study:
    """A study in one folder, run again and again by one command in this process."""

    shadowbench: Callable[..., Any]
    records: Callable[..., list[Record]]
    folder: Path
    plugins: tuple[Path, ...] = ()

    def run(self, text: str, *more: str | Path) -> Any:
        """The command's answer."""
        file = self.folder.parent / "study.toml"
        file.write_text(text, encoding="utf-8")
        flags = [word for plugin in self.plugins for word in ("--plugin", plugin)]
        return self.shadowbench("run", "-s", file, *flags, *more, "-o", self.folder)

    def rows(self, kind: str) -> list[Record]:
        """Scores, or times that were taken: a timing that failed has no time of a frame."""
        return [row for row in self.records(self.folder, kind) if kind == "score" or "frame_ms" in row]

    def added(self, text: str, *more: str | Path) -> tuple[int, int]:
        """Scores and times that a run adds to rows.jsonl, whose earlier lines stay as they are."""
        before = self.folder / "rows.jsonl"
        start = before.read_bytes() if before.exists() else b""
        counts = [len(self.rows(kind)) for kind in ("score", "time")]
        answer = self.run(text, *more)
        assert answer.code in (0, 3), answer.err
        assert before.read_bytes().startswith(start)
        scores, times = (len(self.rows(kind)) - count for kind, count in zip(("score", "time"), counts, strict=True))
        return scores, times


@pytest.fixture
def study(shadowbench: Callable[..., Any], records: Callable[..., list[Record]], tmp_path: Path) -> Study:
    return Study(shadowbench, records, tmp_path / "out")


def environment(**changes: str | Path) -> Mapping[str, str]:
    return os.environ | {name: str(value) for name, value in changes.items()}
