"""Filters as they stand in a deployment file: one section for each kind of the registry."""

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Literal, Optional, Self, Union

from pydantic import BeforeValidator, Field, create_model, model_validator

from canshaper.config.desk import Objective
from canshaper.config.inputs import InputSection, NamedCodes
from canshaper.config.limits import Limits, Sway
from canshaper.config.section import RUN, Origin, Section, expanded, number
from canshaper.shaping.registry import KINDS
from canshaper.shaping.shapers.kind import Parameter, ShaperKind
from canshaper.shaping.sway import SwayMode

# A list parameter that may be longer than this may write a run of equal numbers as one entry.
_FEW = 8


# A filter still fits where the file's swing differs from its design by no more than this: length,
# where it covers no range of its own (a stopwatch is no more exact), and damping ratio.
_LENGTH_PCT = 5.0
_DAMPING = 0.03


class SecondMode(Section):
    """A second mode that a filter was designed for, such as that of long logs."""

    period_s: Annotated[float, number(0.15, 25, "s", "time of one full swing")]
    damping_ratio: Annotated[float, number(0, 0.95, "", "damping ratio")]
    length_range_pct: Annotated[
        float, number(0, 60, "%", "error of the pendulum length that it covers, +-")
    ]


class DesignedFor(Section):
    """Swing and valve that a filter was designed for; compared with the file when it is loaded."""

    period_s: Annotated[float, number(0.15, 25, "s", "time of one full swing")]
    damping_ratio: Annotated[float, number(0, 0.95, "", "damping ratio")]
    length_range_pct: (
        Annotated[float, number(0, 60, "%", "error of the pendulum length that it covers, +-")]
        | None
    ) = None
    duration_s: (
        Annotated[float, number(0, 60, "s", "length of its response, which the tail has to let be")]
        | None
    ) = None
    second: SecondMode | None = Field(None, description="second mode that it covers")
    valve_rate_per_s: (
        Annotated[float, number(0, 100, "full speeds per s", "rate of the valve that it keeps to")]
        | None
    ) = None
    objective: Objective | None = Field(None, description="what tune chose the poles by")
    origin: Origin | None = Field(None, description="where the filter, and its swing, come from")

    def faults(
        self, mode: SwayMode, valve_rate_per_s: float, tail_s: float
    ) -> Iterator[tuple[str, str]]:
        """Yield (key, reason) for each design value that does not fit the axis.

        Args:
            mode: sway mode of the axis.
            valve_rate_per_s: rate of its valve, full speeds per second.
            tail_s: how long its limits let the output run on, seconds.
        """
        low, high = _periods(self.period_s, self.length_range_pct or 0.0)
        if not low <= mode.period_s <= high:
            yield (
                "period_s",
                f"expected a swing of {low:.2f} to {high:.2f} s, got {mode.period_s:.2f} s",
            )
        low, high = max(self.damping_ratio - _DAMPING, 0.0), self.damping_ratio + _DAMPING
        if not low <= mode.damping_ratio <= high:
            text = f"expected a damping ratio of {low:.3f} to {high:.3f}"
            yield "damping_ratio", f"{text}, got {mode.damping_ratio:.3f}"
        rate = self.valve_rate_per_s or 0.0
        if valve_rate_per_s < rate:
            text = (
                f"expected a valve of {rate:g} full speeds per s or more, got {valve_rate_per_s:g}"
            )
            yield "valve_rate_per_s", text
        if tail_s < (self.duration_s or 0.0):
            text = f"expected limits.tail_s of {self.duration_s:g} s or more, got {tail_s:g} s"
            yield "duration_s", text

    def reversal_s(self, limits: Limits) -> float | None:
        """Return the ``reversal_s`` (s) needed where these limits cut the response off; else None.

        The compensation of a cut knows the first mode only; a second mode swings on.
        """
        out = limits.output_limits()
        needed_s = (self.duration_s or 0.0) + out.maximum / out.fall_per_s
        enough = not self.second or out.allow_reverse or out.reversal_s >= needed_s
        return None if enough else math.ceil(10.0 * needed_s) / 10.0

    def stretch_fault(self, factor: float) -> str | None:
        """Return why the response cannot be stretched in time by a factor, or None.

        The second mode of the tool keeps its period, which the stretched filter has to cover.
        """
        if self.second is None:
            return None
        low, high = _periods(self.second.period_s * factor, self.second.length_range_pct)
        if low <= self.second.period_s <= high:
            return None
        return (
            f"expected {low:.2f} to {high:.2f} s for the second mode that the filter would cover"
            f" then, got {self.second.period_s:g} s; design it again"
        )


def _periods(period_s: float, length_range_pct: float) -> tuple[float, float]:
    """Shortest and longest period over a range of lengths: period grows with root of length."""
    share = max(length_range_pct, _LENGTH_PCT) / 100.0
    return period_s * math.sqrt(1.0 - share), period_s * math.sqrt(1.0 + share)


class FilterSection(Section):
    """A filter: its ``kind``, and its parameters by their names in the registry."""

    kind: str

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if check := KINDS[self.kind].check:
            check(**self.parameters())
        return self

    @property
    def runs_ahead(self) -> bool:
        """Whether the filter runs far ahead of the demand, see ``ShaperKind``."""
        return KINDS[self.kind].runs_ahead

    def parameters(self) -> dict[str, Any]:
        """Return the parameters for ``build_shaper``, by name."""
        return self.model_dump(exclude={"kind", "designed_for"}, exclude_none=True)

    def design(self) -> DesignedFor | None:
        """Return the swing and valve that the filter was designed for, where the file has them."""
        return getattr(self, "designed_for", None)


def _section(kind: ShaperKind) -> type[FilterSection]:
    """The section of a kind, such as ``TwoModeFilter``."""
    extra = _or_false if kind.name == "off" else None
    name = Field(description=kind.summary, json_schema_extra=extra)
    fields: dict[str, Any] = {"kind": (Literal[kind.name], name)}
    fields |= {p.name: _field(p) for p in kind.parameters}
    if kind.designed_by:
        text = f"what canshaper {kind.designed_by} designed it for"
        fields["designed_for"] = (DesignedFor | None, Field(None, description=text))
    # No class can be written down here: a package adds a kind when it is installed.
    return create_model(
        f"{kind.name.title().replace('_', '')}Filter",
        __base__=FilterSection,
        __module__=__name__,
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
        many = most > _FEW
        extra = _with_runs if many else None
        field = Field(min_length=least, max_length=most, description=text, json_schema_extra=extra)
        one = Annotated[list[one], field]
        if many:
            one = Annotated[one, BeforeValidator(expanded)]
    if parameter.optional:
        return Optional[one], None  # noqa: UP045  (made while the program runs)
    return one, ... if parameter.default is None else parameter.default


def _with_runs(schema: dict[str, Any]) -> None:
    """Allow runs of equal numbers in the JSON schema of a list."""
    text = "so many equal numbers"
    run = {"type": "string", "pattern": f"^{RUN}$", "description": text}
    schema["items"] = {"anyOf": [schema["items"], run]}


def _or_false(schema: dict[str, Any]) -> None:
    """Allow false for ``off`` in the JSON schema, as YAML 1.1 reads it; see ``_named_off``."""
    schema["enum"] = [schema.pop("const"), False]
    del schema["type"]


SECTIONS = {name: _section(kind) for name, kind in KINDS.items()}
"""Section of each kind, by its name."""
globals().update({section.__name__: section for section in SECTIONS.values()})  # for pickle


def _named_off(section: Any) -> Any:
    """Read false as ``off``: YAML 1.1 takes ``off`` for false, and its tools write it so."""
    if isinstance(section, dict) and section.get("kind") is False:
        return section | {"kind": "off"}
    return section


if TYPE_CHECKING:
    Filter = FilterSection
else:
    Filter = Annotated[
        Union[tuple(SECTIONS.values())],  # noqa: UP007  (the same)
        Field(discriminator="kind"),
        BeforeValidator(_named_off),
    ]


def filter_of(kind: str, **parameters: Any) -> Filter:
    """Return the section of a filter, as in a deployment file.

    Raises:
        ValidationError: a file with these parameters would be refused.
        KeyError: there is no filter of this kind.
    """
    return SECTIONS[kind].model_validate({"kind": kind, **parameters})


def designed(mode: SwayMode) -> dict[str, float]:
    """Return the keys of ``designed_for`` that state the swing: period (s) and damping ratio."""
    return {"period_s": round(mode.period_s, 4), "damping_ratio": round(mode.damping_ratio, 4)}


class Breakpoint(Section):
    """Sway and filter at one value of the load state; between two values both are interpolated."""

    breakpoint: Annotated[float, number(-1e6, 1e6, "", "value of the load state")]
    sway: Sway = Field(description="sway data at this value")
    filter: Filter = Field(description="filter at this value")


class Profile(Section):
    """Filter of an axis while the operator has chosen this profile."""

    filter: Filter = Field(description="filter of the axis")
    gain_schedule: list[Breakpoint] = Field([], description="sway and filter by the load state")

    @model_validator(mode="after")
    def _of_one_kind(self) -> Self:
        if fault := schedule_fault(self.filter.kind, self.gain_schedule):
            raise ValueError(fault)
        return self


class LoadState(NamedCodes, InputSection):
    """A signal that says what hangs on the crane: closed or open, weight of the load, period."""

    signal: str = Field(description="signal with the value that the breakpoints name")
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


class ProfileSwitch(InputSection):
    """A switch or display with which the operator chooses how the crane responds."""

    signal: str = Field(description="signal with the code of the choice")
    codes: dict[str, Annotated[int, number(0, 65535, "", "code of a profile")]] = Field(
        min_length=1, description="code of each profile by its name"
    )
    timeout_ms: Annotated[int, number(10, 60_000, "ms", "age at which it counts as lost")]


def schedule_fault(kind: str, sets: Sequence[Breakpoint]) -> str | None:
    """Return why a gain schedule does not fit a filter of this kind, or None."""
    if not sets:
        return None
    if not KINDS[kind].needs_sway:
        return f"filter {kind} knows no sway; a gain schedule is for filters that do"
    for one in sets:
        if one.sway.length:
            return "expected no length at a breakpoint, but in the sway of the axis"
        if one.filter.kind != kind:
            return f"expected the filter of the axis, {kind}, got {one.filter.kind} at a breakpoint"
    values = [one.breakpoint for one in sets]
    if any(a >= b for a, b in pairwise(values)):
        got = ", ".join(f"{value:g}" for value in values)
        return f"expected rising breakpoints, got {got}"
    return None
