"""Pydantic models that refuse what they do not know, and their errors told in one line."""

from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

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


def explain(where: str, error: ValidationError) -> InputError:
    """The first complaint of a ValidationError as one line: where, which field, what was found, what is allowed."""
    first = error.errors(include_url=False)[0]
    field = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")
    found = "" if isinstance(first["input"], dict | list | BaseModel) else f" (found {first['input']!r:.60})"
    return InputError(f"{where}: {field + ': ' if field else ''}{message}{found}")
