"""Declared versions of what makes a row's numbers, and those of libraries. Keys hash them in place of our Python code.

Results with an older one are measured again; tidying raises none.
`tests/test_probes.py` fails when numbers change and the version does not.
"""

from functools import cache
from importlib.metadata import PackageNotFoundError, version

VERSION = "0.1.0"
"""Version of this package."""

DRAW = 4
"""Raised when Python code changes a mask, count of work, fact or number of bytes; shaders and plug-ins are hashed."""
TRACE = 3
"""Raised when any array of a truth changes."""
SCORE = 3
"""Raised when a metric or another number about a given mask and truth changes, or is added."""

MOTION = 1
"""Raised when a score of several frames changes, or is added."""

ENGINES = 2
"""Raised when Python code changes the mask of another engine: its scene, its light's box, or masks made of pictures."""

ABSENT = "not installed"


@cache
def installed(library: str) -> str:
    """Version of a distribution; some platforms lack some."""
    try:
        return version(library)
    except PackageNotFoundError:
        return ABSENT


def of_truths() -> dict[str, str]:
    """Versions that truths depend on, by name."""
    return {"trace": str(TRACE), **{name: installed(name) for name in ("embreex", "numpy", "scipy")}}


def of_scores() -> dict[str, str]:
    """Versions that scores of a given mask depend on, by name."""
    return {"score": str(SCORE), **of_truths()}


def of_rows() -> dict[str, str]:
    """Versions that rows depend on, by name."""
    return {"draw": str(DRAW), **{name: installed(name) for name in ("moderngl", "pyglm")}, **of_scores()}
