"""A fault at any place of any file's schema is an ordinary problem with its line.

The files are made from the schemas themselves, so that no new section is forgotten. They have every
key, also those that exclude each other; such problems may come on top of what is looked for.
"""

import math
import re
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Union, get_args, get_origin

import annotated_types
import pytest
import yaml
from pydantic.fields import FieldInfo

from canshaper.config.load import load_section
from canshaper.config.schema import DeploymentConfig
from canshaper.config.section import Section
from canshaper.config.source import Place
from canshaper.errors import ConfigError, Problem
from canshaper.shaping.registry import KINDS
from studies.crane.config import CraneConfig

FILES = [(DeploymentConfig, kind) for kind in KINDS] + [(CraneConfig, "")]
RANGE = re.compile(
    r"expected (a whole number, )?[-+.\de]+( to [-+.\de]+)?.*, got (-?1(0{12}|e\+12)|nan)"
)
files = pytest.mark.parametrize(
    ("schema", "kind"), FILES, ids=[f"{schema.__name__} {kind}" for schema, kind in FILES]
)


class Dumper(yaml.SafeDumper):
    """Writes ``Keys`` as any other mapping."""


class Keys(dict[str, Any]):
    """A section, and those of its keys that it must have."""

    def __init__(self, data: dict[str, Any], required: list[str]) -> None:
        super().__init__(data)
        self.required = required


Dumper.add_representer(Keys, yaml.SafeDumper.represent_dict)


def whole(annotation: Any, kind: str, metadata: tuple[Any, ...] = ()) -> Any:
    """Data with every key that the schema knows and a good value for each; filters of one kind."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return whole(arguments[0], kind, metadata + arguments[1:])
    if origin in (Union, types.UnionType):
        return whole(one_of(arguments, kind), kind, metadata)
    limits = {type(m): m for part in metadata for m in getattr(part, "metadata", [part])}
    least = limits.get(annotated_types.MinLen, annotated_types.MinLen(2)).min_length
    if origin in (list, dict):
        entries = [whole(arguments[-1], kind) for _ in range(least)]
        return entries if origin is list else {f"name{i}": e for i, e in enumerate(entries)}
    if isinstance(annotation, type) and issubclass(annotation, Section):
        fields = annotation.model_fields.items()
        keys = [name for name, field in fields if field.is_required() and name != "kind"]
        return Keys({name: of_field(field, kind) for name, field in fields}, keys)
    if annotation in (int, float):
        return annotation(limits[annotated_types.Ge].ge)
    of_literal = kind if kind in arguments else next(iter(arguments), None)
    return {str: "text", Any: "text", bool: True}.get(annotation, of_literal)


def one_of(arguments: tuple[Any, ...], kind: str) -> Any:
    """The only type next to None, or the filter of this kind."""
    some = [a for a in arguments if a is not types.NoneType]
    if len(some) == 1:
        return some[0]
    of_kind = (s for s in some if kind in get_args(s.model_fields["kind"].annotation))
    return next(of_kind, some[0])  # the first one of cranes


def of_field(field: FieldInfo, kind: str) -> Any:
    if isinstance(field.default, str):
        return field.default
    if field.examples:
        return field.examples[0]
    return whole(field.annotation, kind, (field,))


def places(data: Any, at: Place = ()) -> Iterator[tuple[Place, Any]]:
    """Every place of a file but its top, with what stands there."""
    inside = data.items() if isinstance(data, dict) else enumerate(data)
    for key, value in inside:
        yield (*at, key), value
        if isinstance(value, dict | list):
            yield from places(value, (*at, key))


def put(data: Any, place: Place, value: Any) -> None:
    for key in place[:-1]:
        data = data[key]
    data[place[-1]] = value


def problems(directory: Path, schema: type[Section], data: Any) -> dict[str, Problem]:
    """Problems by their places; each has the line of its key, or of the section that lacks it."""
    file = directory / "file.yaml"
    text = yaml.dump(data, Dumper=Dumper, sort_keys=False)
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_section(file, schema)
    lines = text.splitlines()
    for problem in caught.value.problems:
        assert problem.line
        *_, section, key = ("", *problem.where.split("."))
        key = section if problem.message.startswith("missing") else key
        assert lines[problem.line - 1].lstrip(" -").startswith("" if key.isdigit() else f"{key}:")
    return {problem.where: problem for problem in caught.value.problems}


def where(place: Place) -> str:
    return ".".join(str(key) for key in place)


@files
def test_a_wrong_key_in_every_section(tmp_path: Path, schema: type[Section], kind: str) -> None:
    data = whole(schema, kind)
    # where every name is good, none is wrong
    named = {"buses", "joysticks", "axes", "motion", "profiles", "codes", "nodes", "adjustable"}
    named |= {"options", "shares", "switches", "simulated"}  # check knows those of the last one
    sections = [p for p, value in places(data) if isinstance(value, dict) and p[-1] not in named]
    assert sections
    for place in sections:
        put(data, (*place, "wrong"), 1)
    problem_at = problems(tmp_path, schema, data)
    assert problem_at.keys() == {where((*place, "wrong")) for place in sections}
    assert all(p.message.startswith("expected one of the keys ") for p in problem_at.values())


@pytest.mark.slow
@files
def test_a_wrong_type_at_every_place(tmp_path: Path, schema: type[Section], kind: str) -> None:
    deepest = max(len(place) for place, _ in places(whole(schema, kind)))
    for depth in range(1, deepest + 1):
        data = whole(schema, kind)
        # a filter whose kind is wrong is not looked into any further
        here = {p: v for p, v in places(data) if len(p) == depth and p[-1] != "kind"}
        for place, value in here.items():
            put(data, place, 3 if isinstance(value, dict | list) else ["wrong"])
        problem_at = problems(tmp_path, schema, data)
        for place in here:
            message = problem_at[where(place)].message
            assert message.startswith("expected ")
            assert message.endswith((", got 3", ", got ['wrong']"))
            assert "Input should" not in message  # which is what pydantic says


@files
def test_no_key_in_any_section_that_needs_it(
    tmp_path: Path, schema: type[Section], kind: str
) -> None:
    for depth in range(1, 1 + max(len(place) for place, _ in places(whole(schema, kind)))):
        data = whole(schema, kind)
        sections = [(p, v) for p, v in places(data) if len(p) == depth and isinstance(v, Keys)]
        missing = {where((*place, key)) for place, one in sections for key in one.required}
        for _, section in sections:
            for key in section.required:
                del section[key]
        problem_at = problems(tmp_path, schema, data) if missing else {}
        assert all(problem_at[place].message.startswith("missing: ") for place in missing)


@files
def test_a_number_beyond_its_range_at_every_place(
    tmp_path: Path, schema: type[Section], kind: str
) -> None:
    numbers = [(p, type(v)) for p, v in places(whole(schema, kind)) if type(v) in (int, float)]
    for value in (-(10**12), 10**12, float("nan")):
        data = whole(schema, kind)
        for place, number in numbers:
            put(data, place, number(value) if math.isfinite(value) else value)
        problem_at = problems(tmp_path, schema, data)
        for place, _ in numbers:
            assert RANGE.match(problem_at[where(place)].message), where(place)


@pytest.mark.parametrize("value", ["wrong", ["wrong"], {}, None])
def test_a_wrong_kind_of_every_filter(tmp_path: Path, value: object) -> None:
    data = whole(DeploymentConfig, "gff")
    here = [p for p, _ in places(data) if p[-2:] == ("filter", "kind")]
    assert len(here) == 1 + 2 + 2 * (1 + 2)  # of the axis, its sets, its feels and theirs
    for place in here:
        put(data, place, value)
    problem_at = problems(tmp_path, DeploymentConfig, data)
    for place in here:
        assert "expected one of 'off', 'gff'" in problem_at[where(place)].message


def test_faults_in_sets_are_reported_as_everywhere(tmp_path: Path) -> None:
    data = whole(DeploymentConfig, "gff")
    axis = data["axes"]["name0"]
    axis["gain_schedule"][0]["breakpoint"] = 1e7
    axis["gain_schedule"][1]["filter"]["poles_rad_s"] = [-4.0, 4.0]
    del axis["gain_schedule"][1]["sway"]["full_speed_m_s"]
    axis["profiles"]["name1"]["gain_schedule"][1] = {"breakpoint": 1.0}
    problem_at = problems(tmp_path, DeploymentConfig, data)
    assert {
        "axes.name0.gain_schedule.0.breakpoint": "expected -1e+06 to 1e+06, got 10000000.0",
        "axes.name0.gain_schedule.1.filter.poles_rad_s.1": ("expected -100 to -0.1 rad/s, got 4.0"),
        "axes.name0.gain_schedule.1.sway.full_speed_m_s": (
            "missing: speed of the tip at full command, scales the sway shown (m/s)"
        ),
        "axes.name0.profiles.name1.gain_schedule.1.filter": "missing: filter at this value",
    }.items() <= {place: problem.message for place, problem in problem_at.items()}.items()
