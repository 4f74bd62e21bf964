"""Filters as they stand in a deployment file, one section for each kind of the registry."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from canshaper.config.section import Section, number
from canshaper.shaping.fir import Fir
from canshaper.shaping.gff import poles_from_denominator

Pole = Annotated[float, number(-100, -0.1, "rad/s", "pole of the filter")]


class FilterSection(Section):
    """A filter: its ``kind`` and its parameters by the names the registry takes."""

    kind: str

    def parameters(self) -> dict[str, Any]:
        """Parameters for ``build_shaper``."""
        return self.model_dump(exclude={"kind"}, exclude_none=True)


class OffFilter(FilterSection):
    """No shaping: output limits only."""

    kind: Literal["off"]


class GffFilter(FilterSection):
    """The limit-aware G_FF, by its denominator (``a1``, ``a2``) or by its poles."""

    kind: Literal["gff"]
    a1: Annotated[float, number(1e-3, 20, "s", "coefficient a1 of the denominator")] | None = None
    a2: Annotated[float, number(1e-6, 100, "s^2", "coefficient a2 of the denominator")] | None = (
        None
    )
    poles_rad_s: Annotated[list[Pole], Field(min_length=2, max_length=2)] | None = None
    third_pole_rad_s: (
        Annotated[float, number(-100, -0.1, "rad/s", "a third pole, which removes the first jump")]
        | None
    ) = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        given = self.parameters().keys() - {"third_pole_rad_s"}
        if given == {"a1", "a2"}:
            assert self.a1 and self.a2
            poles_from_denominator(self.a1, self.a2)
        elif given != {"poles_rad_s"}:
            found = ", ".join(sorted(given)) or "neither"
            raise ValueError(f"found {found}; allowed are a1 and a2, or poles_rad_s")
        return self


class FirstOrderFilter(FilterSection):
    """A first-order lag."""

    kind: Literal["first_order"]
    time_constant_s: Annotated[float, number(0.01, 5, "s", "time to 63 % of a step")]


class SCurveFilter(FilterSection):
    """Limited rate and limited change of rate."""

    kind: Literal["s_curve"]
    rate_per_s: Annotated[float, number(0.2, 100, "full speeds per s", "fastest change")]
    jerk_per_s2: Annotated[
        float, number(0.2, 1000, "full speeds per s^2", "fastest change of the rate")
    ]


class ZvFilter(FilterSection):
    """Zero vibration, or zero vibration and derivative."""

    kind: Literal["zv", "zvd"]


class EiFilter(FilterSection):
    """Extra-insensitive."""

    kind: Literal["ei"]
    residual_pct: Annotated[float, number(0.1, 20, "%", "swing left at the nominal period")] = 5.0


class TwoModeFilter(FilterSection):
    """ZV for the sway of the axis and for a second mode, such as a log in the grapple."""

    kind: Literal["two_mode"]
    period_s: Annotated[float, number(0.15, 12, "s", "period of the second mode")]
    damping_ratio: Annotated[float, number(0, 0.95, "", "damping ratio of the second mode")]


class RobustFilter(FilterSection):
    """A non-negative impulse response, designed for a range of pendulum lengths."""

    kind: Literal["robust"]
    tick_ms: Annotated[int, number(1, 200, "ms", "period of the taps: that of the valve")]
    taps: Annotated[
        list[Annotated[float, number(0, 1, "", "tap of the impulse response")]],
        Field(min_length=1, max_length=1000),
    ]

    @model_validator(mode="after")
    def _complete(self) -> Self:
        Fir(self.taps)
        return self

    def parameters(self) -> dict[str, Any]:
        """The taps; their tick is checked against the valve's period."""
        return {"taps": self.taps}


Filter = (
    OffFilter
    | GffFilter
    | FirstOrderFilter
    | SCurveFilter
    | ZvFilter
    | EiFilter
    | TwoModeFilter
    | RobustFilter
)
