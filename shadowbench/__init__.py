"""shadowbench: real-time shadow techniques, scored against ray tracing.

The commands as functions, and the types of their arguments and results; imported from `shadowbench.api` on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from shadowbench import versions

if TYPE_CHECKING:
    from shadowbench.advice.recommend import Recommendation
    from shadowbench.api import (
        close,
        load,
        needs,
        recommend,
        render,
        run,
        score,
        stress,
        truth,
    )
    from shadowbench.errors import InputError, ShadowbenchError
    from shadowbench.measure.pictures import Rendering
    from shadowbench.plugin.base import Technique
    from shadowbench.plugin.params import param
    from shadowbench.plugin.spec import Spec
    from shadowbench.reports.notebook import Results
    from shadowbench.scenes.model import Scene
    from shadowbench.survey.survey import Needs
    from shadowbench.truths.trace import Truth

__version__ = versions.VERSION
__all__ = [
    "InputError",
    "Needs",
    "Recommendation",
    "Rendering",
    "Results",
    "Scene",
    "ShadowbenchError",
    "Spec",
    "Technique",
    "Truth",
    "close",
    "load",
    "needs",
    "param",
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
    return getattr(import_module("shadowbench.api"), name)  # lazily, since importing NumPy and pandas is slow


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
