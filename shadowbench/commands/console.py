"""How we speak to people: notes and progress on stderr, results on stdout."""

import json
import logging
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.measure import Measurement
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from shadowbench.errors import InputError, printable
from shadowbench.files import replace_file
from shadowbench.measure.printed import Cut

if TYPE_CHECKING:
    from shadowbench.techniques.base import Technique

# A pipe has no width; tables there are as wide as they like to be, and a spec stays in one piece.
out = Console(highlight=False, width=None if sys.stdout.isatty() else 500)
err = Console(stderr=True, highlight=False)

_LONGEST_WORD = 24  # characters


class ConsoleReporter(logging.Handler):
    """Notes and a progress bar for each stage of a run; silent when told so.

    A context manager, in which the package's logged warnings are notes too.
    """

    def __init__(self, quiet: bool) -> None:
        super().__init__(logging.WARNING)
        self._quiet = quiet
        self._noted: set[str] = set()
        self._task: TaskID | None = None
        columns = (
            TextColumn("{task.description:<24.24}"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            TextColumn("{task.fields[what]}"),
        )
        self._progress = Progress(*columns, console=err, disable=quiet or not err.is_terminal, transient=True)

    def __enter__(self) -> "ConsoleReporter":
        logging.getLogger("shadowbench").addHandler(self)
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        logging.getLogger("shadowbench").removeHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        """Print a logged warning as a note."""
        self.note(record.getMessage())

    def note(self, line: str) -> None:
        """Print a line once."""
        if not self._quiet and line not in self._noted:
            self._noted.add(line)
            err.print(f"note: {printable(line)}", markup=False, soft_wrap=True)

    def stage(self, name: str, total: int, what: str = "") -> None:
        """Begin a bar in place of the last; `what` it begins with stands behind it."""
        if self._task is not None:
            self._progress.remove_task(self._task)
        self._task = self._progress.add_task(name, total=total, what=what)

    def step(self, what: str) -> None:
        """Advance the bar."""
        if self._task is not None:
            self._progress.update(self._task, advance=1, what=what)


def techniques_with(plugins: Sequence[Path]) -> Mapping[str, "type[Technique]"]:
    """All techniques by name; what a plug-in prints while it is loaded goes to stderr, and is cut."""
    from shadowbench.techniques.registry import techniques  # and with it moderngl, which not every command needs

    stream = Cut(sys.stderr)
    with redirect_stdout(stream), redirect_stderr(stream):
        return techniques(plugins)


def check_outputs(suffix: str, *files: Path | None) -> None:
    """Raise, before any work is done, the InputError that writing one of the files would end in.

    Each must end with `suffix`: what is written is of that format, whatever the name says.
    """

    class Probed(Exception):
        """The file could be written."""

    named = [file for file in files if file is not None]
    for file in named:
        if [other.resolve() for other in named].count(file.resolve()) > 1:
            raise InputError(f"{file}: is named twice; each output needs a file of its own")
        try:
            with replace_file(file):
                raise Probed
        except Probed:
            pass
        if file.suffix.lower() != suffix:
            raise InputError(f"{file}: found a name that ends with {file.suffix or 'no suffix'!r}; allowed: {suffix}")


def check_folder(folder: Path, own: str = "rows.jsonl") -> None:
    """Raise InputError where files lie in a folder, hidden ones aside, and not `own`, the one that tells it is ours."""
    try:
        found = sorted(file.name for file in folder.iterdir() if not file.name.startswith("."))
    except OSError:  # no such folder yet, or one that cannot be written either, which is told there
        return
    if found and own not in found:
        allowed = f"a new folder, an empty one, or one with {own}"
        raise InputError(f"{folder}: found other files, such as {found[0]:.60}; allowed: {allowed}")


def say_unsupported(statuses: Sequence[str]) -> None:
    """Say on stderr, as a command's last line, that nothing was drawn as all of its cells are unsupported."""
    if statuses and all(status.startswith("unsupported") for status in statuses):
        which = "the only cell is" if len(statuses) == 1 else f"all {len(statuses)} cells are"
        err.print(f"shadowbench: nothing was drawn, {which} {statuses[0]}", markup=False, soft_wrap=True)


def print_table(table: Table) -> None:
    """Print a table of which nothing is cut: where the terminal is too narrow for it, its lines are longer.

    Columns that may wrap do so between words; only words longer than _LONGEST_WORD are broken.
    """
    unlimited = out.options.update(width=10_000)
    for column in table.columns:
        sizes = [Measurement.get(out, unlimited, cell) for cell in (column.header, *column.cells)]
        words = min(max(size.minimum for size in sizes), _LONGEST_WORD)
        column.min_width = max(size.maximum for size in sizes) if column.no_wrap else words
        column.overflow = "fold"
    least = Measurement.get(out, unlimited, table).minimum
    table.width = least if least > out.width else None
    out.print(table, crop=False)


def print_json(value: Any) -> None:
    """One JSON document on stdout."""
    print(json.dumps(value, indent=2, allow_nan=False))


def number(value: float) -> str:
    """Four significant digits, without an exponent where it can be."""
    return f"{value:.4g}" if value == 0 or abs(value) >= 1e-4 else f"{value:.2e}"
