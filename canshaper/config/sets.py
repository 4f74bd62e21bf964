"""Which sway data and filter are in force: by the grapple, and by the operator's choice."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.filters import Filter
from canshaper.config.input import Input
from canshaper.config.section import Section, number
from canshaper.config.sway import Sway
from canshaper.shaping.registry import KINDS


class SetConfig(Section):
    """Sway and filter at one value of the grapple's signal; between two values interpolated."""

    at: Annotated[float, number(-1e6, 1e6, "", "value of the grapple's signal")]
    sway: Sway = Field(description="sway data at this value")
    filter: Filter = Field(discriminator="kind", description="filter at this value")


class Feel(Section):
    """Filter of an axis while the operator has chosen it."""

    filter: Filter = Field(discriminator="kind", description="filter of the axis")
    sets: list[SetConfig] = Field([], description="sway and filter by the state of the grapple")

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        if fault := sets_fault(self.filter.kind, self.sets):
            raise ValueError(fault)
        return self


class Grapple(Input):
    """A signal that tells what hangs on the crane: closed or open, weight of the load, period."""

    signal: str = Field(description="signal with the value that the sets name")
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


class FeelSwitch(Input):
    """A switch or display with which the operator chooses how the crane feels."""

    signal: str = Field(description="signal with the code of the choice")
    codes: dict[str, Annotated[int, number(0, 65535, "", "code of a feel")]] = Field(
        min_length=1, description="code of each feel by its name"
    )
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


def sets_fault(kind: str, sets: Sequence[SetConfig]) -> str | None:
    """Why sets cannot stand beside a filter of this kind, or None."""
    if not sets:
        return None
    if not KINDS[kind].needs_sway:
        return f"filter {kind} knows no sway; sets are for filters that do"
    for one in sets:
        if one.filter.kind != kind:
            return f"found a set with filter {one.filter.kind}, allowed is that of the axis, {kind}"
    values = [one.at for one in sets]
    if any(a >= b for a, b in pairwise(values)):
        found = ", ".join(f"{value:g}" for value in values)
        return f"found sets at {found}; allowed are rising values"
    return None
