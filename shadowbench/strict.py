"""Reading files written by users: TOML within limits, strict pydantic models, and one-line error messages."""

import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError, model_validator
from pydantic_core import ErrorDetails

from shadowbench.errors import InputError, alternatives
from shadowbench.options import ViewSize

Model = TypeVar("Model", bound=BaseModel)

DEEPEST = 20
"""Deepest nesting of tables and lists."""


def read_toml(path: Path, where: str, missing: str = "no such file") -> dict[str, Any]:
    """Read a TOML file whose integers fit in 64 bits and whose nesting is at most DEEPEST.

    Raises InputError, its message beginning with `where` or the path, for other files.
    """
    try:
        if not path.is_file():  # reading a named pipe would block
            raise InputError(f"{path}: {'is not a file' if path.exists() else missing}")
        text = path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:  # ValueError: not UTF-8, or a null byte in the path
        raise InputError(f"{path}: cannot be read: {short(error)}") from error
    try:
        # tomllib also raises plain ValueError (integers of thousands of digits) and RecursionError (deep nesting).
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where}: not TOML: {short(error)}") from error
    waiting: list[tuple[str, Any, int]] = [("", document, 0)]
    while waiting:  # not recursive: dotted keys may nest deeper than Python's recursion limit
        key, value, depth = waiting.pop()
        if depth > DEEPEST:
            raise InputError(f"{where}: {key:.60}: nested deeper than {DEEPEST} tables and lists")
        if isinstance(value, dict | list):
            parts = value.items() if isinstance(value, dict) else enumerate(value, 1)
            waiting += [(f"{key}.{name}" if key else str(name), part, depth + 1) for name, part in parts]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:  # tomllib accepts these
            raise InputError(f"{where}: {key:.60}: found an integer beyond 64 bits; TOML allows up to 2^63 - 1")
    return document


def short(error: BaseException) -> str:
    """Message of a foreign exception in one line of at most 200 characters."""
    return " ".join(str(error).split())[:200] or type(error).__name__


class Strict(BaseModel):
    """Frozen model of user input: unknown keys, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _name_what_is_allowed(cls, values: Any) -> Any:
        for key in values if isinstance(values, dict) else ():
            if key not in cls.model_fields:
                raise ValueError(f"unknown field {key!r:.60}{alternatives(key, cls.model_fields, none='none at all')}")
        return values


def _view_size(value: Any) -> ViewSize:
    try:
        return ViewSize.of(value)
    except InputError as error:
        raise ValueError(str(error).removeprefix("view_size: ")) from None


ViewSizeField = Annotated[ViewSize, PlainValidator(_view_size)]
_TABLE = "a table"
_ALLOWED = {
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    "string_type": "text",
    **dict.fromkeys(("list_type", "tuple_type"), "a list"),
    "dict_type": _TABLE,
    "model_type": _TABLE,
    "too_short": "{min_length} or more entries",
    "too_long": "at most {max_length} entries",
    "string_too_short": "{min_length} or more characters",
    "string_too_long": "at most {max_length} characters",
    "union_tag_not_found": "one that has {discriminator}",
    "string_pattern_mismatch": "text that matches {pattern}",
}
"""What is allowed, by pydantic's error type, for errors that pydantic explains in terms of Python."""


def validated(model: type[Model], values: object, where: str, context: object = None) -> Model:
    """The values as a model. Raises InputError that begins with `where`."""
    try:
        return model.model_validate(values, context=context)
    except ValidationError as error:
        raise explain(where, error) from error


def explain(where: str, error: ValidationError) -> InputError:
    """InputError of a ValidationError's first error: where, which field, what was found, what is allowed."""
    complaints = error.errors(include_url=False)
    first = complaints[0]
    place, message = first["loc"], _message(first)
    # A union field has one error per member type, all of one value; their locations end with the member's name.
    same = [other for other in complaints if other["loc"][:-1] == place[:-1] and other["input"] is first["input"]]
    if any(isinstance(other["loc"][-1], str) and not other["loc"][-1].isidentifier() for other in same if other["loc"]):
        # Member types that are our own classes cannot be written in a file.
        allowed = " or ".join(_allowed(other) for other in same if other["type"] != "is_instance_of")
        place, message = place[:-1], f"found {_found(first['input'])}; allowed: {allowed}"
    field = "".join(f" {part + 1}" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    return InputError(f"{where}: {field + ': ' if field else ''}{message}")


def _message(complaint: ErrorDetails) -> str:
    found = _found(complaint["input"])
    if complaint["type"] == "missing":
        return "found none; it must be given"
    if complaint["type"] == "json_invalid":
        return f"found no JSON ({complaint['ctx']['error']}); allowed: a JSON object"
    if complaint["type"] != "value_error":
        return f"found {found}; allowed: {_allowed(complaint)}"
    message = complaint["msg"].removeprefix("Value error, ")  # our own message, which may include what was found
    complete = "found" in message or found in message or not isinstance(complaint["input"], str | int | float)
    return message if complete else f"{message} (found {found})"


def _allowed(complaint: ErrorDetails) -> str:
    if complaint["type"] in _ALLOWED:
        return _ALLOWED[complaint["type"]].format(**complaint.get("ctx", {}))
    return complaint["msg"].removeprefix("Input should be ")


def _found(value: object) -> str:
    if isinstance(value, dict | BaseModel):
        return _TABLE
    return f"{value!r:.60}" if value != [] else "an empty list"
