"""Which sway data and filter are in force: by the load state, and by the operator's choice."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.codes import NamedCodes
from canshaper.config.filters import Filter
from canshaper.config.input import Input
from canshaper.config.section import Section, number
from canshaper.config.sway import Sway
from canshaper.shaping.registry import KINDS


class Breakpoint(Section):
    """Sway and filter at one value of the load state; between two values interpolated."""

    breakpoint: Annotated[float, number(-1e6, 1e6, "", "value of the load state")]
    sway: Sway = Field(description="sway data at this value")
    filter: Filter = Field(description="filter at this value")


class Profile(Section):
    """Response of an axis while the operator has chosen it."""

    filter: Filter = Field(description="filter of the axis")
    gain_schedule: list[Breakpoint] = Field([], description="sway and filter by the load state")

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        if fault := schedule_fault(self.filter.kind, self.gain_schedule):
            raise ValueError(fault)
        return self


class LoadState(NamedCodes, Input):
    """A signal that says what hangs on the crane: closed or open, weight of the load, period."""

    signal: str = Field(description="signal with the value that the breakpoints name")
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


class ProfileSwitch(Input):
    """A switch or display with which the operator chooses how the crane responds."""

    signal: str = Field(description="signal with the code of the choice")
    codes: dict[str, Annotated[int, number(0, 65535, "", "code of a profile")]] = Field(
        min_length=1, description="code of each profile by its name"
    )
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


def schedule_fault(kind: str, sets: Sequence[Breakpoint]) -> str | None:
    """Why a gain schedule cannot stand next to a filter of this kind, or None."""
    if not sets:
        return None
    if not KINDS[kind].needs_sway:
        return f"filter {kind} knows no sway; a gain schedule is for filters that do"
    for one in sets:
        if one.filter.kind != kind:
            return f"expected the filter of the axis, {kind}, got {one.filter.kind} at a breakpoint"
    values = [one.breakpoint for one in sets]
    if any(a >= b for a, b in pairwise(values)):
        got = ", ".join(f"{value:g}" for value in values)
        return f"expected rising breakpoints, got {got}"
    return None
