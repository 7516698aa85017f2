"""OpenGL entry points that moderngl lacks, loaded on first use."""

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

from shadowbench.gl.library import moderngl

_ENUM = _UINT = ctypes.c_uint
_INT = _SIZE = ctypes.c_int
_BOOL = ctypes.c_ubyte
_POINTER = ctypes.c_void_p

# name: (result type, argument types)
SIGNATURES: Mapping[str, tuple[Any, tuple[Any, ...]]] = {
    "glActiveTexture": (None, (_ENUM,)),
    "glBeginQuery": (None, (_ENUM, _UINT)),
    "glBindFramebuffer": (None, (_ENUM, _UINT)),
    "glBindTexture": (None, (_ENUM, _UINT)),
    "glClear": (None, (_UINT,)),
    "glClearStencil": (None, (_INT,)),
    "glClipControl": (None, (_ENUM, _ENUM)),
    "glColorMask": (None, (_BOOL, _BOOL, _BOOL, _BOOL)),
    "glDeleteQueries": (None, (_SIZE, _POINTER)),
    "glDeleteTextures": (None, (_SIZE, _POINTER)),
    "glDepthMask": (None, (_BOOL,)),
    "glEndQuery": (None, (_ENUM,)),
    "glFramebufferTexture": (None, (_ENUM, _ENUM, _UINT, _INT)),
    "glFramebufferTexture2D": (None, (_ENUM, _ENUM, _ENUM, _UINT, _INT)),
    "glFramebufferTextureLayer": (None, (_ENUM, _ENUM, _UINT, _INT, _INT)),
    "glGenQueries": (None, (_SIZE, _POINTER)),
    "glGenTextures": (None, (_SIZE, _POINTER)),
    "glGetIntegerv": (None, (_ENUM, _POINTER)),
    "glGetQueryObjectui64v": (None, (_UINT, _ENUM, _POINTER)),
    "glGetTexImage": (None, (_ENUM, _INT, _ENUM, _ENUM, _POINTER)),
    "glGetTexLevelParameteriv": (None, (_ENUM, _INT, _ENUM, _POINTER)),
    "glGetUniformLocation": (_INT, (_UINT, ctypes.c_char_p)),
    "glStencilFunc": (None, (_ENUM, _INT, _UINT)),
    "glStencilOpSeparate": (None, (_ENUM, _ENUM, _ENUM, _ENUM)),
    "glTexImage2D": (None, (_ENUM, _INT, _INT, _SIZE, _SIZE, _INT, _ENUM, _ENUM, _POINTER)),
    "glTexImage3D": (None, (_ENUM, _INT, _INT, _SIZE, _SIZE, _SIZE, _INT, _ENUM, _ENUM, _POINTER)),
    "glUniform1i": (None, (_INT, _INT)),
    "glUseProgram": (None, (_UINT,)),
}


class RawGL:
    """Calls by name, `raw("glUniform1i", location, 0)`. Raises NotImplementedError for one that the driver lacks."""

    def __init__(
        self, context: moderngl.Context, signatures: Mapping[str, tuple[Any, tuple[Any, ...]]] = SIGNATURES
    ) -> None:
        self._signatures = signatures
        self._load: Callable[[str], int] = context.mglo._context.load_opengl_function
        self._functions: dict[str, Callable[..., Any]] = {}

    def __call__(self, name: str, *arguments: Any) -> Any:
        """Call an entry point and return its result."""
        if name not in self._functions:
            address = self._load(name)
            if not address:
                raise NotImplementedError(f"the OpenGL driver has no {name}")
            result, types = self._signatures[name]
            self._functions[name] = ctypes.CFUNCTYPE(result, *types)(address)
        return self._functions[name](*arguments)

    def integer(self, name: int) -> int:
        """An integer limit or state (glGetIntegerv)."""
        value = ctypes.c_int()
        self("glGetIntegerv", name, ctypes.byref(value))
        return value.value
