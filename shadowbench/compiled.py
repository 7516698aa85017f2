"""What Numba compiles is compiled by the first call on a machine and cached; that wait is announced.

Where Numba finds no folder to cache in, as in a read-only installation of a user without a home, each process compiles.
"""

import logging
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
from numba.core import event
from numba.core.caching import NullCache

_log = logging.getLogger(__name__)

COMPILING = "compiling loops: about 10 s in all, once on a machine"
UNCACHED = (
    "compiling loops: about 10 s in all, in every process, since Numba finds no folder to cache in: set NUMBA_CACHE_DIR"
)


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
    """Make a call that compiles, the first time in this process only; a message if it does, and not from the cache."""
    with event.install_listener("numba:compile", _Announcer()):
        call()


class _Announcer(event.Listener):
    """Announces the first compilation in this process, of which Numba tells where its cache has nothing."""

    announced = False

    def on_start(self, event: Any) -> None:
        if not _Announcer.announced:
            _Announcer.announced = True
            _log.warning(UNCACHED if isinstance(event.data["dispatcher"]._cache, NullCache) else COMPILING)

    def on_end(self, event: Any) -> None:
        pass
