"""shadowbench: real-time shadow techniques, scored against ray tracing.

What the commands compute, as functions: see `shadowbench.api`, whose names are found here when they are used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from shadowbench.api import close, load, needs, recommend, render, run, score, stress, truth
    from shadowbench.errors import InputError, ShadowbenchError

__version__ = "0.1.0"
__all__ = [
    "InputError",
    "ShadowbenchError",
    "close",
    "load",
    "needs",
    "recommend",
    "render",
    "run",
    "score",
    "stress",
    "truth",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module("shadowbench.api"), name)  # NumPy alone takes longer than `import shadowbench` may


def __dir__() -> list[str]:
    return [*globals(), *__all__]
