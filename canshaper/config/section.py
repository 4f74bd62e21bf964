"""Parts of which every configuration file is made: sections, and origins of measured numbers."""

import ast
import inspect
import re
from collections.abc import Iterable, Iterator
from datetime import date
from functools import cache
from itertools import pairwise
from typing import Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, GetJsonSchemaHandler, model_validator
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema

from canshaper.config.source import Place

VERSION = 1
"""Version of the file's format."""


def number(low: float, high: float, unit: str, text: str) -> Any:
    """Field of a number within [low, high]; the unit appears in errors and in the JSON schema."""
    return Field(
        ge=low,
        le=high,
        allow_inf_nan=False,
        description=f"{text} ({unit})" if unit else text,
        json_schema_extra={"unit": unit},
    )


class Section(BaseModel):
    """A part of the file: frozen, no unknown keys, no silent conversion of types."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    @classmethod
    def description(cls, key: str) -> str | None:
        """Return a short description of a key: that of its field, or the docstring behind it."""
        field = cls.model_fields.get(key)
        return (field and field.description) or _docstrings(cls).get(key)

    @classmethod
    def documentation(cls, key: str) -> str | None:
        """Return the full text on a key: the docstring behind it, else its short description."""
        return _docstrings(cls).get(key) or cls.description(key)

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Return the JSON schema; a key without a description gets that of its section."""
        built = handler(schema)
        for name, key in handler.resolve_ref_schema(built).get("properties", {}).items():
            texts = [one["description"] for one in key.get("anyOf", ()) if "description" in one]
            if text := cls.documentation(name) or next(iter(texts), None):
                key["description"] = text
        return built


@cache
def _docstrings(section: type[Section]) -> dict[str, str]:
    """Return the docstring behind each key of a section, read from the source of its class.

    pydantic's ``use_attribute_docstrings`` would read those of all sections at every start.
    """
    texts: dict[str, str] = {}
    for one in reversed(section.__mro__):
        if not issubclass(one, Section) or one is Section:
            continue
        try:
            (tree,) = ast.parse(inspect.getsource(one)).body
        except OSError:  # it is made while the program runs
            continue
        assert isinstance(tree, ast.ClassDef)
        for key, text in pairwise([*tree.body, ast.Pass()]):
            if not isinstance(key, ast.AnnAssign):
                continue
            assert isinstance(key.target, ast.Name)
            texts.pop(key.target.id, None)  # that of the key it takes the place of
            if isinstance(text, ast.Expr):
                assert isinstance(text.value, ast.Constant)
                texts[key.target.id] = " ".join(str(text.value.value).split())
    return texts


def sections(part: Any, place: Place = ()) -> Iterator[tuple[Place, Section]]:
    """Yield every section in a part of a file with its place; the part too if it is one."""
    if isinstance(part, Section):
        yield place, part
        below: Iterable[tuple[str | int, Any]] = part
    elif isinstance(part, dict):
        below = part.items()
    else:
        below = enumerate(part) if isinstance(part, list) else ()
    for key, one in below:
        yield from sections(one, (*place, key))


RUN = r"([1-9][0-9]{0,3}) x ([0-9]+(?:\.[0-9]+)?(?:[eE][-+]?[0-9]+)?)"
_RUN = re.compile(RUN)
_MOST = 10_000  # far above any list's own limit: a few runs must not make a list without end


def expanded(entries: Any) -> Any:
    """Return the list with each run ("3 x 0.5") written out; other entries are not checked."""
    if not isinstance(entries, list):
        return entries
    numbers: list[Any] = []
    for entry in entries:
        run = _RUN.fullmatch(entry) if isinstance(entry, str) else None
        numbers += [float(run[2])] * int(run[1]) if run else [entry]
        if len(numbers) > _MOST:
            break
    return numbers


class Origin(Section):
    """Origin of measured numbers, which a verb writes next to them."""

    date: str = Field(
        description="day on which they were written", json_schema_extra={"format": "date"}
    )
    log: str | None = Field(
        None, description="what they were computed from: name of the log, stopwatch"
    )
    by: str = Field(description="verb and version that wrote them")
    source: Literal["machine", "simulated"] | None = Field(
        None, description="measured on the machine or on a simulated crane; none where not known"
    )

    @model_validator(mode="after")
    def _a_day(self) -> Self:
        try:
            date.fromisoformat(self.date)
        except ValueError:
            raise ValueError(f"date: expected one such as 2026-11-23, got {self.date!r}") from None
        return self


def simulated(part: Any, place: Place = ()) -> Iterator[Place]:
    """Yield the places of numbers in a deployment that were measured on a simulated crane."""
    for where, section in sections(part, place):
        if isinstance(section, Origin) and section.source == "simulated":
            yield where
