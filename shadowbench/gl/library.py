"""moderngl; where it is not installed only its names, so that techniques are listed and specs and rows are read."""

from types import ModuleType


class MissingModule(ModuleType):
    """Stands for a library whose types occur in annotations and isinstance checks; nothing is an instance of them."""

    def __getattr__(self, name: str) -> type:
        return type(name, (), {})


try:
    import moderngl as moderngl
except ModuleNotFoundError:  # no wheel for this platform: docs/how-to/install.md
    moderngl = MissingModule("moderngl")
