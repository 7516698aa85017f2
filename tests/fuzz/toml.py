"""Writes Python values, including absurd ones, as TOML, which the standard library only reads."""

import datetime
import json
from typing import Any


def dumps(document: dict[str, Any]) -> str:
    """A document as TOML: arrays of tables as [[name]], everything deeper inline."""
    plain = {key: value for key, value in document.items() if not _tables(value)}
    lines = [f"{_key(key)} = {_value(value)}" for key, value in plain.items()]
    for key, tables in document.items():
        for table in tables if _tables(tables) else []:
            lines.append(f"[[{_key(key)}]]")
            lines += [f"{_key(name)} = {_value(part)}" for name, part in table.items()]
    return "\n".join(lines) + "\n"


def _tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(part, dict) for part in value)


def _key(key: Any) -> str:
    return _quoted(str(key))


def _quoted(text: str) -> str:
    # JSON's escapes are TOML's, but for DEL, and for characters beyond 16 bits, which go as they are.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007F")


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_value(part)}" for key, part in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(_value(part) for part in value) + "]"
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return repr(value) if isinstance(value, int | float) else _quoted(str(value))
