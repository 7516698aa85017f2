"""What Numba compiles is compiled by the first call on a machine and cached; that wait is announced.

Where Numba finds no folder to cache in, as in a read-only installation of a user without a home, each process compiles.
"""

import logging
from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numba.core import event
from numba.core.caching import NullCache

_log = logging.getLogger(__name__)
_own: list[Any] = []  # what `compiled` has returned

COMPILING = "compiling loops: 10 s in all, once on a machine"
UNCACHED = (
    "compiling loops: 10 s in all, in every process, since Numba finds no folder to cache in: set NUMBA_CACHE_DIR"
)

DISABLED = bool(numba.config.DISABLE_JIT)  # type: ignore[attr-defined]  # by NUMBA_DISABLE_JIT


def compiled(**options: Any) -> Callable[[Any], Any]:
    """Decorator: `numba.njit` without the GIL, cached on disk if possible; Python with NUMBA_DISABLE_JIT."""

    def compile_cached(function: Any) -> Any:
        if DISABLED:  # Python would warn of what compiled code computes in silence, such as 0/0
            return np.errstate(all="ignore")(function)
        _own.append(cached_if_possible(lambda cache: numba.njit(nogil=True, cache=cache, **options)(function)))
        return _own[-1]

    return compile_cached


def cached_if_possible(make: Callable[[bool], Any]) -> Any:
    """What `make` compiles, cached on disk if it says so."""
    try:
        return make(True)
    except RuntimeError:  # no folder that can be written
        return make(False)


class _Announcer(event.Listener):
    """Announces the first compilation in this process; of what its cache has, Numba tells nothing."""

    announced = False

    def on_start(self, event: Any) -> None:
        dispatcher = event.data["dispatcher"]
        if not _Announcer.announced and any(dispatcher is one for one in _own):
            _Announcer.announced = True
            _log.warning(UNCACHED if isinstance(dispatcher._cache, NullCache) else COMPILING)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcer())  # type: ignore[no-untyped-call]
