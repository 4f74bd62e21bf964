"""Filters as they stand in a deployment file: one section for each kind of the registry."""

from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional, Self, Union

from pydantic import ConfigDict, Field, create_model, model_validator

from canshaper.config.section import Section, number
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.kind import Parameter, ShaperKind


class FilterSection(Section):
    """A filter: its ``kind`` and its parameters by the names the registry takes."""

    # Made from the rows of the registry, each with its description: there is no source to read.
    model_config = ConfigDict(use_attribute_docstrings=False)

    kind: str

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if check := KINDS[self.kind].check:
            check(**self.parameters())
        return self

    def parameters(self) -> dict[str, Any]:
        """Parameters for ``build_shaper``."""
        return self.model_dump(exclude={"kind"}, exclude_none=True)

    def __reduce__(self) -> Any:
        # The class of a kind is in no module; another process has made its own from the same row.
        return restored_filter, (self.kind, self.model_fields_set, self.__dict__)


def _section(kind: ShaperKind) -> type[FilterSection]:
    """The section of a kind, such as ``TwoModeFilter``."""
    fields: dict[str, Any] = {"kind": (Literal[kind.name], Field(description=kind.summary))}
    fields |= {p.name: _field(p) for p in kind.parameters}
    return create_model(
        f"{kind.name.title().replace('_', '')}Filter",
        __base__=FilterSection,
        __doc__=kind.summary,
        **fields,
    )


def _field(parameter: Parameter) -> tuple[Any, Any]:
    """Type and default of a parameter."""
    limits = number(parameter.low, parameter.high, parameter.unit, parameter.description)
    one: Any = Annotated[int if parameter.whole else float, limits]
    if parameter.entries:
        least, most = parameter.entries
        text = parameter.description
        one = Annotated[list[one], Field(min_length=least, max_length=most, description=text)]
    if parameter.optional:
        return Optional[one], None  # noqa: UP045  (made while the program runs)
    return one, ... if parameter.default is None else parameter.default


SECTIONS = {name: _section(kind) for name, kind in KINDS.items()}
"""Section of each kind, by its name."""


def restored_filter(kind: str, given: set[str], values: dict[str, Any]) -> FilterSection:
    """Make the section of a filter again that was taken apart with ``pickle``."""
    return SECTIONS[kind].model_construct(given, **values)


if TYPE_CHECKING:
    Filter = FilterSection
else:
    Filter = Union[tuple(SECTIONS.values())]  # noqa: UP007  (the same)


def filter_of(kind: str, **parameters: Any) -> Filter:
    """A filter as it would stand in a deployment file.

    Raises:
        ValidationError: the file would be refused.
    """
    return SECTIONS[kind].model_validate({"kind": kind, **parameters})
