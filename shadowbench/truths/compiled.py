"""What Numba compiles is compiled by the first call on a machine and cached; that wait is announced."""

import logging
import threading
from collections.abc import Callable
from functools import cache

_log = logging.getLogger(__name__)

PATIENCE = 1.0  # seconds; loading from the cache takes less


@cache
def compile_once(call: Callable[[], None]) -> None:
    """Make a call that compiles, the first time in this process only; a message if it takes long."""
    timer = threading.Timer(PATIENCE, _log.warning, ["compiling the ray tracer's loops: about 10 s, once on a machine"])
    timer.start()
    try:
        call()
    finally:
        timer.cancel()
