"""Pydantic models that refuse what they do not know, and their errors told in one line."""

from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails

from shadowbench.errors import InputError


class Strict(BaseModel):
    """A frozen model for what users write: unknown keys, NaN and infinity are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @model_validator(mode="before")
    @classmethod
    def _name_what_is_allowed(cls, values: Any) -> Any:
        if isinstance(values, dict):
            for key in values:
                if key not in cls.model_fields:
                    allowed = ", ".join(cls.model_fields) or "none at all"
                    raise ValueError(f"unknown field {key!r}; allowed: {allowed}")
        return values


_TABLE = "a table"
_ALLOWED = {
    "int_type": "a whole number",
    "int_parsing": "a whole number",
    "int_from_float": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "string_type": "text",
    "list_type": "a list",
    "dict_type": _TABLE,
    "model_type": _TABLE,
    "too_short": "{min_length} or more entries",
    "too_long": "at most {max_length} entries",
    "string_too_short": "{min_length} or more characters",
    "string_too_long": "at most {max_length} characters",
}
"""What is allowed, by pydantic's name of a complaint, where its own words are those of Python."""


def explain(where: str, error: ValidationError) -> InputError:
    """The first complaint of a ValidationError as one line: where, which field, what was found, what is allowed."""
    complaints = error.errors(include_url=False)
    first = complaints[0]
    place, message = first["loc"], _message(first)
    # A field that takes one of several types has a complaint for each, all of one value, the type behind its place.
    same = [other for other in complaints if other["loc"][:-1] == place[:-1] and other["input"] is first["input"]]
    if any(isinstance(other["loc"][-1], str) and not other["loc"][-1].isidentifier() for other in same if other["loc"]):
        allowed = " or ".join(_allowed(other) for other in same)
        place, message = place[:-1], f"found {_found(first['input'])}; allowed: {allowed}"
    field = "".join(f" {part + 1}" if isinstance(part, int) else f".{part}" for part in place).lstrip(".")
    return InputError(f"{where}: {field + ': ' if field else ''}{message}")


def _message(complaint: ErrorDetails) -> str:
    found = _found(complaint["input"])
    if complaint["type"] == "missing":
        return "found none; it must be given"
    if complaint["type"] != "value_error":
        return f"found {found}; allowed: {_allowed(complaint)}"
    message = complaint["msg"].removeprefix("Value error, ")  # one of ours, which may say what it found
    told = "found" in message or found in message or not isinstance(complaint["input"], str | int | float)
    return message if told else f"{message} (found {found})"


def _allowed(complaint: ErrorDetails) -> str:
    if complaint["type"] in _ALLOWED:
        return _ALLOWED[complaint["type"]].format(**complaint.get("ctx", {}))
    return complaint["msg"].removeprefix("Input should be ")


def _found(value: object) -> str:
    if isinstance(value, dict | BaseModel):
        return _TABLE
    return f"{value!r:.60}" if value != [] else "an empty list"
