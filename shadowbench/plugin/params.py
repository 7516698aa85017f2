"""Parameters of techniques. One pydantic field defines the spec key, shader define or uniform, help, docs and column.

A `Component` is a bias, filter, fit or split, with parameters of its own. Defining a subclass with a `name` adds it to
its family's table, and so to the allowed values of every technique parameter of that family, `bias: Bias = param(…)`.

Grammar of a spec:

    spec  = name [":" item {"," item}]        item = key "=" value
    value = one {"+" one}        one = number | word ["(" argument {"," argument} ")"]        argument = [key "="] value
"""

import inspect
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import Field, ModelWrapValidatorHandler, model_validator
from pydantic.fields import FieldInfo

from shadowbench.errors import InputError, alternatives
from shadowbench.files import PACKAGE
from shadowbench.strict import Strict

Items = tuple[tuple[str | None, Any], ...]
"""(key, value) pairs; the key of a positional argument is None."""
WORD = r"[A-Za-z0-9][\w-]*"
DEEPEST = 8
"""Largest depth of nested calls."""
_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w-]))"
    rf"|(?P<word>{WORD})|(?P<mark>[=(),:+]))"
)


@dataclass(frozen=True)
class Call:
    """A word with parameters, `slope(max=0.05)`, or a sum, with the name `+` and both operands as arguments."""

    name: str
    arguments: Items = ()

    def keywords(self, order: list[str]) -> dict[str, Any]:
        """The arguments by name, positional ones in `order`. Raises ValueError for too many or repeated ones."""
        named: dict[str, Any] = {}
        for index, (key, value) in enumerate(self.arguments):
            if key is None and index >= len(order):
                raise ValueError(f"{self.name} takes at most {len(order)} parameters: {', '.join(order) or 'none'}")
            name = order[index] if key is None else key
            if name in named:
                raise ValueError(f"{self.name}: {name} is given twice")
            named[name] = value
        return named

    def __str__(self) -> str:
        return f"{self.name}(…)" if self.arguments else self.name


class Reader:
    """Parser of one spec."""

    def __init__(self, text: str) -> None:
        self.text, self.at = text, 0

    def fail(self, wanted: str) -> InputError:
        rest = self.text[self.at :].strip()
        return InputError(f"spec {self.text!r}: expected {wanted}, found {repr(rest[:20]) if rest else 'its end'}")

    def token(self, kind: str, text: str | None = None) -> str | None:
        """Consume and return the next token if it is of this kind (and text); None otherwise."""
        match = _TOKEN.match(self.text, self.at)
        if match is None or match.lastgroup != kind or text not in (None, match[kind]):
            return None
        self.at = match.end()
        return match[kind]

    def end(self) -> None:
        if self.text[self.at :].strip():
            raise self.fail("a comma or the end")

    def value(self, depth: int = 0) -> Any:
        """A number, a word, or a Call. depth: number of calls around it."""
        if depth > DEEPEST:
            raise InputError(f"spec {self.text!r}: nested deeper than {DEEPEST} calls")
        value: Any
        if number := self.token("number"):
            value = int(number) if re.fullmatch(r"[-+]?\d+", number) else float(number)
        elif not (word := self.token("word")):
            raise self.fail("a number or a word")
        elif self.token("mark", "("):
            value = Call(word, self.items(named=False, depth=depth + 1))
            if not self.token("mark", ")"):
                raise self.fail("')'")
        else:
            value = {"true": True, "false": False}.get(word, word)
        return Call("+", ((None, value), (None, self.value(depth + 1)))) if self.token("mark", "+") else value

    def items(self, named: bool = True, depth: int = 0) -> Items:
        """Items separated by commas; named: whether each must have a key."""
        items: list[tuple[str | None, Any]] = []
        while True:
            start = self.at
            key = self.token("word")
            if key is None or not self.token("mark", "="):
                if named:
                    raise self.fail("key=value")
                self.at, key = start, None
            items.append((key, self.value(depth)))
            if not self.token("mark", ","):
                return tuple(items)


def parameters_of(spec: str) -> tuple[str, dict[str, Any]]:
    """A spec's technique and the parameters that it names: numbers, words and Calls."""
    reader = Reader(spec)
    technique = reader.token("word") or ""
    items = reader.items() if reader.token("mark", ":") else ()
    return technique, {str(key): value for key, value in items}


def parse_value(text: str) -> Any:
    """One value: a number, a word, or a Call."""
    reader = Reader(text)
    value = reader.value()
    reader.end()
    return value


def param(default: Any, help: str, *, metres: bool = False, values: str = "", **limits: Any) -> Any:
    """A parameter: default, one line of help, and pydantic limits (ge, gt, le, lt).

    metres: the value is a length in file units, converted to a local length when its uniform is set; values: the
    allowed ones in words, if the type does not say them.
    """
    return Field(default, description=help, json_schema_extra={"metres": metres, "values": values}, **limits)


def allowed(info: FieldInfo) -> str:
    """The allowed values of a parameter as text: `d16, d24, d32f` or `≥ 0, metres`; empty for a component."""
    if isinstance(info.json_schema_extra, dict) and info.json_schema_extra.get("values"):
        return str(info.json_schema_extra["values"])
    if get_origin(info.annotation) is Literal:
        return ", ".join(map(str, get_args(info.annotation)))
    if info.annotation is bool:
        return "true, false"
    signs = {"ge": "≥", "gt": ">", "le": "≤", "lt": "<"}
    limits = [
        f"{sign} {getattr(limit, key):g}"
        for limit in info.metadata
        for key, sign in signs.items()
        if getattr(limit, key, None) is not None
    ]
    return ", ".join([*limits, "metres"] if in_metres(info) else limits)


def in_metres(info: FieldInfo) -> bool:
    """Whether a parameter is a length in file units."""
    return isinstance(info.json_schema_extra, dict) and bool(info.json_schema_extra.get("metres"))


class SubjectParams(Strict):
    """Base class of the parameters of every technique and engine."""


class Component(Strict):
    """Base class of biases, filters, fits, splits, updates, contacts and histories; a `name` adds one to its table."""

    name: ClassVar[str]
    shader: ClassVar[str] = ""  # file that fills the include slot of the parameter, or its text of several lines
    table: ClassVar[dict[str, type[Self]]]
    presets: ClassVar[dict[str, str]] = {}  # parameters in spec syntax, by name: `screen-space(preset=bevy)`
    lifts: ClassVar[bool] = False  # whether shadows are received on the smooth surface, not on its triangles
    remembers: ClassVar[bool] = False  # whether a frame depends on the frames before
    unwritten: ClassVar[bool] = False  # whether full specs leave it out, so that those of before it existed are equal

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        super().__pydantic_init_subclass__(**kwargs)
        if Component in cls.__bases__:
            cls.table = {}
        elif "name" in cls.__dict__:
            other = cls.table.get(cls.name, cls)
            if (other.__module__, other.__qualname__) != (cls.__module__, cls.__qualname__):  # else imported again
                places = " and ".join(inspect.getfile(one) for one in (other, cls))
                raise InputError(f"two {cls.family().__name__.lower()}s are called {cls.name!r}: {places}")
            cls.table[cls.name] = cls  # type: ignore[assignment]  # Self is a subclass of the family here

    @classmethod
    def family(cls) -> "type[Component]":
        """The family of a component: `Bias`, `Filter`, `Fit` or `Split`."""
        return next(base for base in cls.__mro__ if Component in base.__bases__)

    @classmethod
    def plugin_files(cls) -> list[Path]:
        """The files outside this package that define the class or its bases; its shader may lie beside them."""
        files = [Path(inspect.getfile(base)) for base in cls.__mro__ if issubclass(base, Component)]
        return [file for file in dict.fromkeys(files) if not file.is_relative_to(PACKAGE)]

    @classmethod
    def from_value(cls, value: "Component | str | Call") -> Self:
        """The component that a value in a spec names. Raises ValueError with the allowed names."""
        if isinstance(value, cls):
            return value
        if isinstance(value, str):
            value = parse_value(value)
        call, family = value if isinstance(value, Call) else Call(f"{value!s:.60}"), cls.__name__.lower()
        if call.name not in cls.table:
            raise ValueError(f"unknown {family} {call.name!r}{alternatives(call.name, cls.table)}")
        component = cls.table[call.name]
        named = call.keywords(order := list(component.model_fields))
        if preset := named.pop("preset", None):
            if preset not in component.presets:
                raise ValueError(
                    f"{call.name}: unknown preset '{preset!s:.60}'{alternatives(preset, component.presets)}"
                )
            named = parse_value(f"{call.name}({component.presets[preset]})").keywords(order) | named
        return component(**named)

    @model_validator(mode="wrap")
    @classmethod
    def _of_spec(cls, value: Any, validate: ModelWrapValidatorHandler[Self]) -> Self:
        """Validates the fields of a component, or reads one that a spec names."""
        return validate(value) if isinstance(value, dict | Component) else cls.from_value(value)

    def written(self, full: bool = False) -> str:
        """The component in spec syntax; full: with parameters at their defaults."""
        items = format_items(self, full)
        return f"{self.name}({items})" if items else self.name


def components_of(params: SubjectParams | Component | None) -> list[Component]:
    """The components among the values of parameters, and those among theirs."""
    values = [getattr(params, key) for key in type(params).model_fields] if params else []
    components = [value for value in values if isinstance(value, Component)]
    return [each for one in components for each in (one, *components_of(one))]


def format_value(value: Any, full: bool = False) -> str:
    """A parameter's value in spec syntax; `full` includes the parameters of components that are at their defaults."""
    if hasattr(value, "written"):  # a component or a spec
        return str(value.written(full))
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)


def format_items(params: SubjectParams | Component, full: bool = False, skip: str = "") -> str:
    """Parameters in spec syntax, `size=512,wrap=edge`: all if `full`, else those that are not at their defaults."""
    values = {key: getattr(params, key) for key in type(params).model_fields if key != skip}
    return ",".join(
        f"{key}={format_value(value, full)}"
        for key, value in values.items()
        if value != type(params).model_fields[key].default or (full and not getattr(value, "unwritten", False))
    )
