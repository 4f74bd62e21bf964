"""Sections of an axis: limits, slewing and its sway; oil that the axes share."""

from collections.abc import Callable
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from canshaper.config.inputs import InputSection, NamedCodes
from canshaper.config.section import Origin, Section, number
from canshaper.shaping.limits import OutputLimits, ValveCurve
from canshaper.shaping.states import Lost
from canshaper.shaping.sway import SwayMode


class Slewing(Section):
    """Angular speed of a slewing axis at full speed, and the largest radius of its tip."""

    full_speed_rad_s: Annotated[float, number(0.05, 3, "rad/s", "angular speed at full command")]
    largest_radius_m: Annotated[
        float, number(0.5, 120, "m", "radius of the tip when the boom is all out")
    ]


class Position(NamedCodes, InputSection):
    """A measured position; several sections may read one message."""

    signal: str
    timeout_ms: Annotated[int, number(10, 5000, "ms", "age at which it counts as lost")]


class Ends(Position):
    """End stops of an axis by a measured position, in the unit of its signal (``EndStops``)."""

    signal: str = Field(description="signal with the position: a radius, an angle or a length")
    lowest: Annotated[float, number(-1e6, 1e6, "units", "position of the one end stop")]
    highest: Annotated[float, number(-1e6, 1e6, "units", "position of the other one, above it")]
    margin: Annotated[float, number(0, 1000, "units", "how far ahead of an end stop it stops")]
    """How far ahead of an end stop the axis stops: error of the signal, and the way of its age."""
    full_speed: Annotated[
        float, number(-1000, 1000, "units per s", "speed of the position at full positive command")
    ]
    """Speed of the position at full positive command; negative where the position then falls."""
    lag_ms: Annotated[
        float, number(0, 1000, "ms", "lag of the valve and age of the position, together")
    ] = 150.0

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.lowest + 2.0 * self.margin < self.highest:
            text = f"expected more than lowest and twice the margin, got {self.highest:g}"
            raise ValueError(f"highest: {text}")
        if self.full_speed == 0.0:
            raise ValueError("full_speed: expected a speed, got 0")
        return self


class Limits(Section):
    """Output limits of an axis; see ``OutputLimits``."""

    max_pct: Annotated[float, number(1, 100, "% of full speed", "fastest output")] = 100.0
    """Fastest output; the filter works at reduced speed too."""
    min_pct: Annotated[float, number(0, 50, "% of full speed", "outputs below this are zero")] = 0.0
    rise_per_s: Annotated[
        float, number(0.2, 100, "full speeds per s", "fastest growth of the output")
    ] = 5.0
    """Fastest growth of the output: what the valve can follow."""
    fall_per_s: Annotated[
        float, number(1, 100, "full speeds per s", "fastest fall of the output to zero")
    ] = 5.0
    """Fastest fall of the output: what the valve can follow."""
    deadband_pct: Annotated[
        float, number(0, 50, "% of full command", "deadband of the valve, jumped over")
    ] = 0.0
    curve_command_pct: (
        list[Annotated[float, number(-100, 100, "% of full command", "command")]] | None
    ) = None
    """Commands of the measured valve (% of full command), instead of ``deadband_pct``."""
    curve_speed_pct: (
        list[Annotated[float, number(-100, 100, "% of full speed", "speed at a command")]] | None
    ) = None
    """Speeds of the measured valve at each of these commands (% of full speed)."""
    curve_origin: Origin | None = Field(None, description="where this curve comes from")
    tail_s: Annotated[
        float, number(0, 12, "s", "how long the output may stay as fast as was asked before")
    ] = 2.0
    """How long the output may stay as fast as was commanded before, which bounds the run-on after
    release; then it falls to zero by fall_per_s. A shorter tail stops the crane sooner and leaves
    more swing."""
    stop_s: Annotated[
        float, number(0.1, 12, "s", "longest shaped stop after the input was lost, then neutral")
    ] = 2.0
    stop_distance_m: (
        Annotated[float, number(0.05, 200, "m", "farthest that the tip may travel when it stops")]
        | None
    ) = None
    ends: Ends | None = None
    """End stops ahead of which the axis is slowed down, so that it does not hit them."""
    allow_faster: bool = False
    """The output may exceed what the operator commands."""
    allow_reverse: bool = Field(False, description="the output may go against the joystick")
    reversal: Literal["stop", "brake_shaped"] = "stop"
    """The output after the joystick was pulled the other way. With stop it falls by fall_per_s;
    with brake_shaped it runs on along the filter for reversal_s, never faster than was commanded in
    that direction: less swing, later to turn round."""
    reversal_s: Annotated[
        float, number(0.1, 12, "s", "longest motion in the old direction after a reversal")
    ] = 0.45
    """With brake_shaped: longest motion in the old direction after the joystick was pulled the
    other way, the fall included."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min_pct >= self.max_pct:
            raise ValueError(f"min_pct: expected less than max_pct, got {self.min_pct:g}")
        if self.curve() and self.deadband_pct:
            raise ValueError("expected one of deadband_pct and a curve, got both")
        if self.curve_origin and not self.curve():
            raise ValueError("curve_origin: expected a curve with it, got none")
        return self

    @property
    def slowest_per_s(self) -> float:
        """The slower of both rates: what the valve follows in either direction."""
        return min(self.rise_per_s, self.fall_per_s)

    def curve(self) -> ValveCurve | None:
        """Return the measured curve of the valve; None where the file has none.

        Raises:
            ValueError: the points are no curve of a valve.
        """
        command, speed = self.curve_command_pct, self.curve_speed_pct
        if command is None and speed is None:
            return None
        return ValveCurve([v / 100.0 for v in command or []], [v / 100.0 for v in speed or []])

    def output_limits(self) -> OutputLimits:
        """Return the limits in fractions of full scale."""
        return OutputLimits(
            maximum=self.max_pct / 100.0,
            minimum=self.min_pct / 100.0,
            rise_per_s=self.rise_per_s,
            fall_per_s=self.fall_per_s,
            deadband=self.deadband_pct / 100.0,
            curve=self.curve(),
            tail_s=self.tail_s,
            allow_faster=self.allow_faster,
            allow_reverse=self.allow_reverse,
            reversal_s=self.reversal_s if self.reversal == "brake_shaped" else 0.0,
        )


class OtherFlow(Position):
    """Measured flow of functions that are not ours."""

    signal: str = Field(description="signal with that flow, or with what it follows")
    full: Annotated[float, number(1e-6, 1e6, "units", "its value for one full axis flow")]


class Hydraulics(Section):
    """Oil that the pump delivers; see ``FlowBudget``."""

    flow: Annotated[float, number(0.1, 100, "full axis flows", "most that the pump delivers")]
    """Most that the pump delivers, in flows of one axis at full speed."""
    others: Annotated[
        float, number(0, 100, "full axis flows", "what functions take that are not ours")
    ] = 0.0
    """Flow of functions that are not ours. With others_measured it counts while that is lost: 0 as
    if they took nothing, as much as flow to stop all motion."""
    others_measured: OtherFlow | None = None
    """Measured flow of these functions: a signal, whose value full is one full axis flow."""
    shares: dict[str, Annotated[float, number(0, 100, "full axis flows", "of an axis")]] = Field(
        {}, description="what an axis takes at full speed, by name; without an entry 1"
    )
    origin: Origin | None = Field(None, description="where the flow comes from")

    @model_validator(mode="after")
    def _some_left(self) -> Self:
        if self.others >= self.flow and not self.others_measured:
            raise ValueError(f"others: expected less than the flow, got {self.others:g}")
        return self


class RopeSection(Position):
    """Length of the rope, measured; sway and filter follow it while it changes."""

    signal: str = Field(description="signal with the length in m")
    offset_m: Annotated[
        float, number(-20, 50, "m", "from there to the middle of the load, added to it")
    ] = 0.0
    lowest_m: Annotated[float, number(0.3, 150, "m", "shortest pendulum")]
    highest_m: Annotated[float, number(0.3, 150, "m", "longest pendulum")]
    lost: Lost = "longest"
    """Filter while the length is lost or has jumped: longest, that of the longest pendulum; hold,
    that of the last length; neutral, stop and wait for the length."""

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.lowest_m < self.highest_m:
            raise ValueError(f"highest_m: expected more than lowest_m, got {self.highest_m:g}")
        return self


_MODE_OF: Final[dict[frozenset[str], Callable[..., SwayMode]]] = {
    frozenset(("length_m", "damping_nms", "mass_kg")): SwayMode.from_grapple,
    frozenset(("period_s", "damping_ratio")): SwayMode.from_period,
    frozenset(("period_s", "decay_per_swing")): SwayMode.from_decay,
    frozenset(("length_m", "damping_ratio")): SwayMode.from_length,
}


class Sway(Section):
    """Swing of the tool on one axis.

    Either grapple data (``length_m``, ``damping_nms``, ``mass_kg``), or what a stopwatch shows
    (``period_s`` with ``damping_ratio`` or ``decay_per_swing``), or a rope (``length_m``,
    ``damping_ratio``).
    """

    full_speed_m_s: Annotated[
        float, number(0.05, 20, "m/s", "speed of the tip at full command, scales the sway shown")
    ]
    length_m: Annotated[float, number(0.05, 150, "m", "pendulum length")] | None = None
    damping_nms: Annotated[float, number(0, 1e6, "N m s/rad", "damping of the joint")] | None = None
    mass_kg: Annotated[float, number(1, 1e5, "kg", "mass of tool and load")] | None = None
    period_s: Annotated[float, number(0.15, 25, "s", "time of one full swing")] | None = None
    damping_ratio: Annotated[float, number(0, 0.95, "", "damping ratio")] | None = None
    decay_per_swing: (
        Annotated[float, number(0, 0.99, "", "part of the amplitude lost over a full swing")] | None
    ) = None
    length: RopeSection | None = None
    """Measured length of the rope: the filter of the axis is then stretched to that length."""
    origin: Origin | None = Field(None, description="where these numbers come from")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.mode()
        return self

    def mode(self) -> SwayMode:
        """Return the sway mode that these data describe.

        Raises:
            ValueError: the data is incomplete, given twice, or makes no sense.
        """
        others = {"full_speed_m_s", "origin", "length"}
        given = self.model_dump(exclude=others, exclude_none=True)
        if make := _MODE_OF.get(frozenset(given)):
            return make(**given)
        raise ValueError(
            "expected length_m, damping_nms and mass_kg, or period_s and damping_ratio, or period_s"
            " and decay_per_swing, or length_m and damping_ratio, got"
            f" {', '.join(sorted(given)) or 'no sway data'}"
        )

    def at_length(self, length_m: float) -> SwayMode:
        """Return the sway mode of a rope of this length."""
        return SwayMode.from_length(length_m, self.mode().damping_ratio)

    def ends(self) -> list[SwayMode]:
        """Return the modes of the shortest and longest rope; none without a measured length."""
        rope = self.length
        return [self.at_length(end) for end in (rope.lowest_m, rope.highest_m)] if rope else []
