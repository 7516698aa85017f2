"""What Numba compiles is compiled by the first call on a machine and cached; that wait is announced.

Where Numba finds no folder to cache in, as in a read-only installation of a user without a home, each process compiles.
"""

import logging
from collections.abc import Callable
from functools import cache
from typing import Any

import numba
from numba.core import event

_log = logging.getLogger(__name__)

COMPILING = "compiling loops: 10 s in all, once on a machine if Numba can cache them (NUMBA_CACHE_DIR)"


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Decorator: `numba.njit` without the GIL, cached on disk if possible."""
    return lambda function: cached_if_possible(lambda cache: numba.njit(nogil=True, cache=cache, **options)(function))


def cached_if_possible(make: Callable[[bool], Any]) -> Any:
    """What `make` compiles, cached on disk if it says so."""
    try:
        return make(True)
    except RuntimeError:  # no folder that can be written
        return make(False)


@cache
def _announce() -> None:
    _log.warning(COMPILING)


class _Announcer(event.Listener):
    """Announces the first compilation in this process; loops that are read from the cache cause no event."""

    def on_start(self, event: Any) -> None:
        _announce()

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
