"""From a file to a valid configuration, or to every reason why it is none."""

import types
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import annotated_types
from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from canshaper.config.schema import DeploymentConfig
from canshaper.config.source import DeploymentError, Place, Problem, Source


def load_config(path: Path) -> tuple[DeploymentConfig, Source]:
    """Read and validate a deployment file.

    Raises:
        DeploymentError: with every problem of the file, each with its line.
    """
    source = Source(path)
    try:
        return DeploymentConfig.model_validate(source.data), source
    except ValidationError as error:
        problems = [_problem(source, detail) for detail in error.errors()]
        raise DeploymentError(_unique(problems)) from None


def _problem(source: Source, error: ErrorDetails) -> Problem:
    kind, found = error["type"], error["input"]
    path = _in_file(source.data, error["loc"], names_absent_key=kind == "missing")
    owner, field = _place(path)
    if kind == "extra_forbidden":
        keys = ", ".join(owner.model_fields) if owner else ""
        return source.problem(path, f"unknown key; allowed are {keys}")
    if kind == "missing":
        text = field.description if field and field.description else ""
        return source.problem(path, f"missing{': ' + text if text else ''}")
    if kind == "value_error":
        return source.problem(path, str(error["ctx"]["error"]))
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        tags = error.get("ctx", {}).get("expected_tags", "'off', 'gff'")
        found = found.get("kind") if isinstance(found, dict) else found
        return source.problem((*path, "kind"), f"found {found!r}, allowed is {tags}")
    allowed = _range(field) or error["msg"][:1].lower() + error["msg"][1:]
    return source.problem(path, f"found {_short(found)}, allowed is {allowed}")


def _in_file(data: Any, location: tuple[int | str, ...], *, names_absent_key: bool) -> Place:
    """Path in the file for a location of pydantic, which also names branches of unions."""
    path: list[str | int] = []
    for i, part in enumerate(location):
        key = isinstance(data, dict) and part in data
        index = isinstance(data, list) and isinstance(part, int) and part < len(data)
        if key or index:
            path.append(part)
            data = data[part]
        elif names_absent_key and i == len(location) - 1:
            path.append(part)
    return tuple(path)


def _place(path: Place) -> tuple[type[BaseModel] | None, FieldInfo | None]:
    """Section and field that a path of the file belongs to, as far as they exist."""
    owners: list[type[BaseModel]] = [DeploymentConfig]
    field: FieldInfo | None = None
    for part in path:
        owner = next((o for o in owners if part in o.model_fields), None)
        if owner is not None and isinstance(part, str):
            field = owner.model_fields[part]
            below = _sections(field.annotation)
            if part != path[-1] or not below:
                owners = below or [owner]
        elif part is not path[-1]:
            continue  # a name chosen by the user, such as that of an axis
        else:
            field = None
    return (owners[-1] if owners else None), field


def _sections(annotation: Any) -> list[type[BaseModel]]:
    """Every section inside a type, such as those of a union or of the values of a dict."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if get_origin(annotation) in (Union, types.UnionType, dict, list, Annotated):
        return [s for a in get_args(annotation) for s in _sections(a)]
    return []


def _range(field: FieldInfo | None) -> str:
    """Range of a number, with its unit, or nothing."""
    if field is None:
        return ""
    metadata = list(field.metadata)
    extra = field.json_schema_extra
    for argument in get_args(field.annotation):
        for info in getattr(argument, "__metadata__", ()):
            if isinstance(info, FieldInfo):
                metadata += info.metadata
                extra = extra or info.json_schema_extra
    low = next((m.ge for m in metadata if isinstance(m, annotated_types.Ge)), None)
    high = next((m.le for m in metadata if isinstance(m, annotated_types.Le)), None)
    if low is None or high is None:
        return ""
    unit = extra.get("unit", "") if isinstance(extra, dict) else ""
    return f"{low:g} to {high:g} {unit}".rstrip()


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _unique(problems: list[Problem]) -> list[Problem]:
    return sorted(set(problems), key=lambda p: (p.file, p.line or 0, p.where))
