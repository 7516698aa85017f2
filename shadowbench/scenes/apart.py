"""Decoders in a process of their own, as corrupt data can make them crash, hang or allocate any amount of memory."""

import io
import subprocess
import sys
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shadowbench.errors import InputError

MOST_MEMORY = 2 << 30
"""Memory limit of a process that decodes, in bytes."""


def decoded_apart(module: str, seconds: float, where: str, *arrays: NDArray[Any]) -> list[NDArray[Any]]:
    """What `module`, run as a program that calls `serve`, makes of arrays.

    Raises InputError that begins with `where` if it fails, dies, or takes longer than `seconds`.
    """
    # -P: do not import from the current folder, which may have a numpy.py.
    command = [sys.executable, "-P", "-m", module]
    try:
        done = subprocess.run(command, input=_packed(arrays), capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired as error:
        raise InputError(f"{where}: took more than {seconds:.0f} s to decode") from error
    if done.returncode != 0:
        errors = done.stderr.decode(errors="replace").strip().splitlines()
        crash = f"the decoder died with code {done.returncode}"
        raise InputError(f"{where}: {errors[-1][:160] if done.returncode == 1 and errors else crash}")
    return _unpacked(done.stdout)


def serve(decode: Callable[..., Iterable[NDArray[Any]]], memory: int = MOST_MEMORY) -> None:
    """Write what `decode` makes of the arrays of standard input to standard output, within `memory` bytes."""
    import resource  # of POSIX alone

    with suppress(ValueError):  # macOS may refuse
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    try:
        sys.stdout.buffer.write(_packed(decode(*_unpacked(sys.stdin.buffer.read()))))
    except Exception as error:  # the decoder's exceptions for corrupt data vary; the parent reports them
        kind = "" if isinstance(error, InputError) else f"{type(error).__name__}: "
        sys.exit(kind + " ".join(str(error).split()))


def _packed(arrays: Iterable[NDArray[Any]]) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, *arrays, allow_pickle=False)
    return stream.getvalue()


def _unpacked(data: bytes) -> list[NDArray[Any]]:
    with np.load(io.BytesIO(data)) as file:
        return list(file.values())
