"""What Numba compiles is compiled by the first call on a machine and cached; that wait is announced.

Where Numba finds no folder to cache in, as in a read-only installation of a user without a home, each process compiles.
"""

import logging
import threading
from collections.abc import Callable
from functools import cache
from typing import Any

import numba

_log = logging.getLogger(__name__)

PATIENCE = 3.0  # seconds; loading from the cache takes less, on a busy machine too
COMPILING = "compiling loops: about 10 s, once on a machine; if again, Numba cannot cache: set NUMBA_CACHE_DIR"


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Decorator: `numba.njit` without the GIL, cached on disk if possible."""

    def compile_cached(function: Any) -> Any:
        try:
            return numba.njit(nogil=True, cache=True, **options)(function)
        except RuntimeError:  # no folder that can be written
            return numba.njit(nogil=True, **options)(function)

    return compile_cached


@cache
def compile_once(call: Callable[[], None]) -> None:
    """Make a call that compiles, the first time in this process only; a message if it takes long."""
    timer = threading.Timer(PATIENCE, _log.warning, [COMPILING])
    timer.start()
    try:
        call()
    finally:
        timer.cancel()
