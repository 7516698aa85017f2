"""The OpenGL context of a process, its driver's properties, and the entry points that moderngl lacks.

Where moderngl is not installed there are only its names, so that techniques are listed and specs and rows are read.
"""

import ctypes
import sys
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field
from functools import cached_property
from types import ModuleType
from typing import Any, Protocol

from shadowbench.errors import NOT_INSTALLED, NoGLError


class MissingModule(ModuleType):
    """Stands for a library whose types occur in annotations and isinstance checks; nothing is an instance of them."""

    def __getattr__(self, name: str) -> type:
        return type(name, (), {})


try:
    import moderngl as moderngl
except ModuleNotFoundError:  # no wheel for this platform: docs/how-to/install.md
    moderngl = MissingModule("moderngl")


_SUBPIXEL_BITS, _CUBE_MAP_SEAMLESS = 0x0D50, 0x884F
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader", "warp", "basic render")


class RawGL:
    """Calls by name of entry points that return nothing or an int: `raw("glUniform1i", location, 0)`.

    Arguments: ints, and pointers of ctypes. Raises NotImplementedError for an entry point that the driver lacks.
    """

    def __init__(self, context: moderngl.Context) -> None:
        self._load: Callable[[str], int] = context.mglo._context.load_opengl_function
        self._functions: dict[str, Callable[..., int]] = {}

    def __call__(self, name: str, *arguments: Any) -> int:
        """Call an entry point and return its result."""
        if name not in self._functions:
            address = self._load(name)
            if not address:
                raise NotImplementedError(f"the OpenGL driver has no {name}")
            self._functions[name] = ctypes.CFUNCTYPE(ctypes.c_int)(address)
        return self._functions[name](*arguments)

    def integer(self, name: str, *arguments: int) -> int:
        """The integer that an entry point writes to its last argument, such as glGetIntegerv."""
        value = ctypes.c_int()
        self(name, *arguments, ctypes.byref(value))
        return value.value


class Releasable(Protocol):
    """An object with device memory."""

    def release(self) -> object:
        """Free the memory."""


@dataclass(eq=False)
class Device:
    """An OpenGL context (4.1 or newer) and its raw entry points. `draws`: number of draw calls; `samplers`: cache."""

    context: moderngl.Context
    draws: int = 0
    samplers: dict[Hashable, moderngl.Sampler] = field(default_factory=dict)

    @cached_property
    def raw(self) -> RawGL:
        """Entry points that moderngl lacks."""
        return RawGL(self.context)

    @cached_property
    def renderer(self) -> str:
        """Renderer and version strings of the driver."""
        info = self.context.info
        return f"{info['GL_RENDERER']}, {info['GL_VERSION']}"

    @cached_property
    def software(self) -> bool:
        """Whether the renderer runs on the CPU, where timer queries are meaningless and times are not a GPU's."""
        return any(word in self.renderer.lower() for word in _SOFTWARE)

    @cached_property
    def version(self) -> int:
        """OpenGL version, 410 for 4.1."""
        return int(self.context.version_code)

    @cached_property
    def max_map_size(self) -> int:
        """Largest side of a square depth map, in texels."""
        info = self.context.info
        return min(int(info["GL_MAX_TEXTURE_SIZE"]), *(int(side) for side in info["GL_MAX_VIEWPORT_DIMS"]))

    @cached_property
    def subpixel_bits(self) -> int:
        """Bits of the rasteriser's subpixel grid: usually 8; OpenGL requires 4."""
        return self.raw.integer("glGetIntegerv", _SUBPIXEL_BITS)

    def has(self, extension: str, core: int) -> bool:
        """Whether the driver has an extension, or the core version (450 for 4.5) that includes it."""
        return self.version >= core or extension in self.context.extensions

    @property
    def clip_control(self) -> bool:
        """Whether clip-space depth can be 0 to 1, as reversed depth needs."""
        return self.has("GL_ARB_clip_control", 450)

    @property
    def pipeline_statistics(self) -> bool:
        """Whether the driver counts shader invocations and primitives."""
        return self.has("GL_ARB_pipeline_statistics_query", 460)

    @cached_property
    def _fallback_target(self) -> moderngl.Framebuffer:
        return self.context.simple_framebuffer((1, 1))

    def free(self, resources: Iterable[Releasable]) -> None:
        """Release resources after binding another framebuffer, as moderngl would rebind a deleted one."""
        self._fallback_target.use()
        for resource in resources:
            resource.release()

    def reset(self) -> None:
        """Reset state that a technique may have changed by raw calls, so that it cannot affect what is drawn next."""
        self.context.enable_only(moderngl.NOTHING)
        self.context.wireframe = False

    def check(self, what: str) -> None:
        """Raise RuntimeError if OpenGL has recorded an error since the last check."""
        error = self.context.error
        if error != "GL_NO_ERROR":
            raise RuntimeError(f"OpenGL error {error} in {what}")


def open_device() -> Device:
    """A new context without a window. Raises NoGLError, which names the packages to install."""
    if isinstance(moderngl, MissingModule):
        raise NoGLError(NOT_INSTALLED.format("moderngl"))
    options: dict[str, Any] = {"backend": "egl"} if sys.platform.startswith("linux") else {}
    try:
        context = moderngl.create_context(standalone=True, require=410, **options)
    except Exception as error:  # moderngl and glcontext raise bare Exceptions of many texts
        raise NoGLError(
            f"no OpenGL 4.1 context ({str(error).strip() or type(error).__name__}); "
            "on Debian and Ubuntu without a GPU: apt-get install libegl1 libgl1-mesa-dri libgl1"
        ) from error
    return device_of(context)


def device_of(context: moderngl.Context) -> Device:
    """The device of a context that exists, such as a window's."""
    context.gc_mode = "auto"
    context.enable_direct(_CUBE_MAP_SEAMLESS)  # filters read across the edges of cube faces
    return Device(context)
