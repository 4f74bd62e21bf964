"""Loading of a file: a valid configuration, or every reason why it is none."""

import types
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from canshaper.config.schema import DeploymentConfig
from canshaper.config.section import VERSION, Section
from canshaper.config.source import Place, Source
from canshaper.errors import ConfigError, Problem, did_you_mean
from canshaper.shaping.registry import FAULTS

# Former place of a key (* for any name, | between alternatives) and its name in version 1. A key
# inside another moved key comes before that one.
MOVED: Mapping[str, str] = {
    "axes.*.stick|command.lever": "joystick",
    "axes.*.stick": "command",
    "axes.*.sets|gain_schedule.*.at": "breakpoint",
    "axes.*.sets": "gain_schedule",
    "axes.*.feels|profiles.*.sets|gain_schedule.*.at": "breakpoint",
    "axes.*.feels|profiles.*.sets": "gain_schedule",
    "axes.*.feels": "profiles",
    "levers|joysticks.*.frozen_s": "stuck_s",
    "levers": "joysticks",
    "gateway.passing": "forwarding",
    "grapple": "load_state",
    "feel": "profile",
}
# A former key of an axis that is now a section of its own, for two axes.
GONE = "radial_compensation"


def moved_keys(source: Source) -> list[Problem]:
    """Rename every key that moved in the data, and return one problem for each.

    The rest of the file can then be checked as if it had the new names.

    Raises:
        ConfigError: the file is of a later version, so nothing else in it can be checked.
    """
    version = source.data.get("version") if isinstance(source.data, dict) else None
    if type(version) is int and version > VERSION:
        text = f"expected {VERSION}, got {version}: the file is for a later release of canshaper"
        raise ConfigError([source.problem(("version",), text)])
    problems = []
    for pattern, name in MOVED.items():
        for place in [*source.places(pattern.split("."))]:
            problems.append(source.problem(place, f"moved to {name}"))
            source.rename(place, name)
    for place in [*source.places(["axes", "*", GONE])]:
        text = f"moved to motion, next to axes: {{ slew: {place[1]}, near_far: ..., radius: ... }}"
        problems.append(source.problem(place, text))
        source.data["axes"][place[1]].pop(GONE)
    return problems


_S = TypeVar("_S", bound=Section)

_UNIONS = (Union, types.UnionType)

_WORDS = {
    str: "text (in quotes where it looks like a number)",
    bool: "true or false",
    list: "a list",
    dict: "a section with a name for every entry",
}


def load_config(path: Path) -> tuple[DeploymentConfig, Source]:
    """Read and validate a deployment file.

    Raises:
        ConfigError: with every problem of the file, each with its line; or a package that adds
            filters has a fault, so that the list of filters is not certain.
    """
    check_packages()
    source = Source(path)
    moved = moved_keys(source)
    config, problems = _validated(source, DeploymentConfig)
    if config is None or moved:
        raise ConfigError(_sorted(moved + problems))
    on = {name: motion for name, motion in config.motion.items() if not motion.waits}
    return config if on == config.motion else config.model_copy(update={"motion": on}), source


def check_packages() -> None:
    """Refuse to go on where a package that adds filters has a fault.

    Raises:
        ConfigError: one problem for each fault, with the name of the package.
    """
    if FAULTS:
        raise ConfigError([Problem(package, None, "", text) for package, text in FAULTS])


def load_section(path: Path, schema: type[_S]) -> tuple[_S, Source]:
    """Read and validate a file whose whole content is one section.

    Raises:
        ConfigError: with every problem of the file, each with its line.
    """
    source = Source(path)
    config, problems = _validated(source, schema)
    if config is None:
        raise ConfigError(_sorted(problems))
    return config, source


def _validated(source: Source, schema: type[_S]) -> tuple[_S | None, list[Problem]]:
    """Return the section and no problem, or None and every problem of the file."""
    try:
        return schema.model_validate(source.data), []
    except ValidationError as error:
        return None, [_problem(source, detail, schema) for detail in error.errors()]


def limits(schema: type[Section], key: str) -> tuple[float, float]:
    """Return the smallest and largest permitted value of a number, in the unit of its key."""
    limits = _Place.of((key,), schema).limits
    assert limits is not None, key
    return limits


def _problem(source: Source, error: ErrorDetails, schema: type[Section]) -> Problem:
    kind, got, context = error["type"], error["input"], error.get("ctx", {})
    place = _Place.of(error["loc"], schema)
    if kind == "extra_forbidden":
        names = ", ".join(place.owner.model_fields)
        text = f"expected one of the keys {names}, got an unknown one"
        text += did_you_mean(str(error["loc"][-1]), place.owner.model_fields)
    elif kind == "missing":
        text = f"missing: {place.owner.description(str(place.path[-1])) or ''}"
    elif kind == "value_error":
        text = str(context["error"])
    elif kind in ("union_tag_invalid", "union_tag_not_found"):
        place.path += ("kind",)
        got = got.get("kind") if isinstance(got, dict) else got
        text = f"expected one of {context.get('expected_tags', place.kinds)}, got {_short(got)}"
    elif kind in ("too_short", "too_long"):
        number = context["min_length" if kind == "too_short" else "max_length"]
        most = "or more entries" if kind == "too_short" else "entries at most"
        text = f"expected {number} {most}, got {_short(got)}"
    elif kind == "literal_error":
        text = f"expected {context['expected']}, got {_short(got)}"
    else:
        text = f"expected {place.expected or error['msg']}, got {_short(got)}"
    return source.problem(place.path, text)


class _Place:
    """Place of an error: its path in the file, and the type that the schema demands there."""

    def __init__(self, schema: type[Section]) -> None:
        self.path: Place = ()
        self.owner: type[Section] = schema
        self._type: Any = schema
        self._metadata: list[Any] = []

    @classmethod
    def of(cls, location: tuple[int | str, ...], schema: type[Section]) -> Self:
        """Return the place of a pydantic location, which also names branches of unions."""
        place = cls(schema)
        for part in location:
            place._enter(part)
        return place

    def _enter(self, part: int | str) -> None:
        arguments = get_args(self._type)
        sections = [a for a in arguments if isinstance(a, type) and issubclass(a, Section)]
        if isinstance(self._type, type) and issubclass(self._type, Section):
            self.path += (part,)
            self.owner = self._type
            field = self._type.model_fields.get(str(part))
            self._is(field.annotation if field else None, field)
        elif sections and get_origin(self._type) in _UNIONS:  # filters, distinguished by their kind
            self._is(next(s for s in sections if part in _kinds(s)))
        elif arguments and part != "[key]":
            self.path += (part,)
            self._is(arguments[-1])  # of a value of a dict, or of an entry of a list

    def _is(self, annotation: Any, field: FieldInfo | None = None) -> None:
        """Store the type of this place, stripped of ``Annotated`` and ``None``."""
        self._metadata = [field] if field else []
        while annotation is not None:
            arguments = get_args(annotation)
            some = [a for a in arguments if a is not types.NoneType]
            if get_origin(annotation) is Annotated:
                self._metadata += arguments[1:]
                annotation = arguments[0]
            elif get_origin(annotation) in _UNIONS and len(some) == 1:
                annotation = some[0]
            else:
                break
        self._type = annotation

    @property
    def kinds(self) -> str:
        """Every kind of section that may stand here."""
        return ", ".join(repr(k) for section in get_args(self._type) for k in _kinds(section))

    @property
    def _fields(self) -> list[FieldInfo]:
        return [m for m in self._metadata if isinstance(m, FieldInfo)]

    @property
    def limits(self) -> tuple[float, float] | None:
        """Smallest and largest number permitted here; None where the type is no number."""
        marks: list[Any] = [mark for field in self._fields for mark in field.metadata]
        low: Any = next((m.ge for m in marks if isinstance(m, annotated_types.Ge)), None)
        high: Any = next((m.le for m in marks if isinstance(m, annotated_types.Le)), None)
        return None if low is None or high is None else (low, high)

    @property
    def expected(self) -> str:
        """Values that may stand here, in words."""
        if limits := self.limits:
            low, high = limits
            extras = [field.json_schema_extra for field in self._fields]
            units = [extra for extra in extras if isinstance(extra, dict)]
            if low == high:
                return f"{low:g}"
            whole = "a whole number, " if self._type is int else ""
            first, last = (f"{end:.10g}" if whole else f"{end:g}" for end in limits)
            return f"{whole}{first} to {last} {units[0]['unit'] if units else ''}".rstrip()
        if isinstance(self._type, type) and issubclass(self._type, Section):
            return f"a section with the keys {', '.join(self._type.model_fields)}"
        if get_origin(self._type) in _UNIONS:
            return f"a section of the kind {self.kinds}"
        return _WORDS.get(get_origin(self._type) or self._type, "")


def _kinds(section: type[BaseModel]) -> tuple[Any, ...]:
    """Values that the key ``kind`` of a section may have."""
    return get_args(section.model_fields["kind"].annotation)


def _short(value: Any) -> str:
    """Return a short text of a value; "nothing" for a key without one."""
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _sorted(problems: list[Problem]) -> list[Problem]:
    return sorted(set(problems), key=lambda p: (p.file, p.line or 0, p.where))
