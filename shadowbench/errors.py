"""The errors a user can meet, and the exit code of each."""


class ShadowbenchError(Exception):
    """A failure that is told in one line instead of a traceback."""

    exit_code = 3


class InputError(ShadowbenchError):
    """Bad input: the line names the file or field, what was found and what is allowed."""

    exit_code = 2


class NoGLError(ShadowbenchError):
    """No OpenGL context could be made, or it is older than 4.1."""
