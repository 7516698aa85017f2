"""Output of commands: results on stdout; notes, errors and progress on stderr. Rich is imported when used."""

import logging
import sys
from collections.abc import Collection, Iterable, Sequence
from functools import cache
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal

from shadowbench.errors import printable

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import TaskID

    from shadowbench.measure.campaign import Failure
    from shadowbench.measure.rows import Result
    from shadowbench.options import ViewOptions, ViewSize
    from shadowbench.scenes.model import View

_LONGEST_WORD = 24  # characters
_EVERY = 10.0  # seconds between lines of progress where stderr is no terminal


@cache
def out() -> "Console":
    """The console for results, on stdout."""
    from rich.console import Console

    # A pipe has no width: tables are as wide as they need to be, so that no spec is wrapped.
    return Console(highlight=False, width=None if sys.stdout.isatty() else 500)


@cache
def err() -> "Console":
    """The console for everything else, on stderr."""
    from rich.console import Console

    return Console(stderr=True, highlight=False)


def print_line(line: str) -> None:
    """Print a line of the result on stdout."""
    out().print(line, markup=False, soft_wrap=True)


def print_text(text: str) -> None:
    """Print a text on stdout, wrapped between words."""
    out().print(text, markup=False)


def print_error(line: str) -> None:
    """Print a line on stderr."""
    err().print(line, markup=False, soft_wrap=True)


class Reporter(logging.Handler):
    """Notes, and a progress bar for each stage of a run, or a line now and then where stderr is no terminal.

    A context manager, within which warnings that the package logs are printed as notes. Silent if `quiet`.
    """

    def __init__(self, quiet: bool) -> None:
        from rich import progress
        from rich.table import Column

        super().__init__(logging.WARNING)
        self._quiet = quiet
        self._noted: set[str] = set()
        self._task: TaskID | None = None
        self._printed = monotonic()
        self._progress = progress.Progress(
            *progress.Progress.get_default_columns(),
            progress.MofNCompleteColumn(),
            progress.TextColumn("{task.fields[what]}", table_column=Column(ratio=1, no_wrap=True, overflow="ellipsis")),
            console=err(),
            disable=quiet or not err().is_terminal,
            transient=True,
            expand=True,
            speed_estimate_period=300.0,  # cells take seconds, and their times are reported block by block
        )

    def __enter__(self) -> "Reporter":
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
        """Print a note, unless it was printed before."""
        if not self._quiet and line not in self._noted:
            self._noted.add(line)
            print_error(f"note: {printable(line)}")

    def stage(self, name: str, total: int | None) -> None:
        """Replace the progress bar by one of `total` steps, None if unknown."""
        if self._task is not None:
            self._progress.remove_task(self._task)
        self._task = self._progress.add_task(name, total=total, what="")

    def view(self, scene: str, size: "ViewSize | None", options: "ViewOptions") -> "View":
        """The view that the options name, by default of 512² pixels; notes what is assumed about it."""
        from shadowbench.options import DEFAULT_SIZE
        from shadowbench.scenes.opening import chosen_view
        from shadowbench.truths.embree import tracer_of

        return chosen_view(scene, size or DEFAULT_SIZE, options, self.note, tracer_of)

    def step(self, what: str) -> None:
        """Advance the bar; what: text after it."""
        if self._task is None:
            return
        self._progress.update(self._task, advance=1, what=what)
        if self._progress.disable and not self._quiet and monotonic() - self._printed >= _EVERY:
            self._printed = monotonic()
            from shadowbench.studies.run import duration

            (task,) = self._progress.tasks
            of = "" if task.total is None else f" of {task.total:.0f}"
            left = task.time_remaining
            about = "" if left is None else f"about {duration(left)} left, "
            print_error(f"{task.description}: {task.completed:.0f}{of}, {about}{printable(what)}")


def exit_code_of(results: "Sequence[Result]", left_out: "Sequence[Failure]") -> int:
    """3 if a cell failed or something was left out, which is told on stderr; else 0."""
    failed = [one for one in results if one.status.startswith("failed")]
    reasons = [one.status.removeprefix("failed: ") for one in failed]
    places: dict[tuple[str, str], list[str]] = {}  # of each kind and reason
    for one in left_out:
        places.setdefault((one.what, one.reason), []).append(one.where)
    for result, reason in zip(failed, reasons, strict=True):
        places.setdefault(("cell", reason), []).append(f"{result.score['scene']} {result.score['spec']}")
    if left_out or len(places) > 1:
        for (what, reason), where in sorted(places.items(), key=lambda item: -len(item[1])):
            others = "" if len(where) == 1 else f" and {len(where) - 1} more"
            print_error(f"failed: {len(where)} × {what}: {printable(where[0])}{others}: {printable(reason)}")
    if failed:
        print_error(f"shadowbench: {len(failed)} of {len(results)} cells failed; the first: {reasons[0]}")
    return 3 if failed or left_out else 0


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    numbers: Collection[str] = (),
    whole: Collection[str] = (),
) -> None:
    """Print a table without truncation; lines may exceed the terminal's width.

    columns: headings; numbers: right-aligned columns; neither these nor those in `whole` wrap. Other columns wrap
    between words; words over _LONGEST_WORD characters are broken.
    """
    from rich.markup import escape
    from rich.measure import Measurement
    from rich.table import Table

    console = out()
    table = Table(title=escape(title) or None, title_justify="left", box=None, pad_edge=False)
    for heading in columns:
        justify: Literal["right", "left"] = "right" if heading in numbers else "left"
        table.add_column(heading, justify=justify, no_wrap=heading in (*numbers, *whole), overflow="fold")
    for row in rows:
        table.add_row(*map(escape, row))
    unlimited = console.options.update(width=10_000)
    for column in table.columns:
        sizes = [Measurement.get(console, unlimited, cell) for cell in (column.header, *column.cells)]
        words = min(max(size.minimum for size in sizes), _LONGEST_WORD)
        column.min_width = max(size.maximum for size in sizes) if column.no_wrap else words
    least = Measurement.get(console, unlimited, table).minimum
    table.width = least if least > console.width else None
    with console.capture() as captured:
        console.print(table, crop=False)
    for line in captured.get().splitlines():
        print(line.rstrip())  # Rich leaves blanks at the ends of lines


def print_json(value: Any) -> None:
    """One JSON document on stdout; paths are texts."""
    import json

    print(json.dumps(value, indent=2, allow_nan=False, default=str))
