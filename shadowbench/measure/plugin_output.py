"""What plug-ins print, on stderr and apart from results; techniques and engines by name, loaded with them."""

import os
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING

from shadowbench.errors import InputError

if TYPE_CHECKING:
    from shadowbench.plugin.base import Subject, Technique


def forward_output(pipe: IO[bytes]) -> threading.Thread:
    """Forward the output of a process from its pipe to stderr, in a thread, until the pipe is closed."""

    def read() -> None:
        with pipe:
            while data := os.read(pipe.fileno(), 1 << 16):
                with suppress(OSError):  # nobody reads stderr; plug-ins print on
                    os.write(2, data)  # not sys.stderr, which may be redirected by then

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    return thread


def techniques_with(plugins: Sequence[Path]) -> "Mapping[str, type[Technique]]":
    """All techniques by name, those of plug-ins included. What these print on loading goes to stderr.

    Raises InputError for a plug-in that cannot be loaded, and for a metric that has the name of a column.
    """
    from shadowbench.plugin.registry import techniques  # the worker's start does not wait for this import
    from shadowbench.scores.metrics import plug_in, plugged_in

    with redirect_stdout(sys.stderr):
        known = techniques(plugins)
    if metrics := plugged_in():
        from shadowbench.measure.columns import is_taken

        for name in [metric.name for metric in metrics if is_taken(metric.name)]:
            plug_in([])  # a later call does without it
            raise InputError(f"--plugin: a metric is called {name!r}, as is a column; allowed: another name")
    return known


def subjects_with(plugins: Sequence[Path]) -> "Mapping[str, type[Subject]]":
    """As `techniques_with`, and the engines after them. Raises InputError also for a name that an engine has."""
    from shadowbench.plugin.registry import engines, source_file

    techniques = techniques_with(plugins)
    for name in techniques.keys() & engines().keys():
        raise InputError(f"{source_file(techniques[name])}: the name {name!r} is an engine's; allowed: another")
    return {**techniques, **engines()}
