"""Schema of the deployment file. Unknown keys are errors; every number has a range and a unit."""

from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from canshaper.shaping.gff import poles_from_denominator
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.sway import SwayMode


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

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Bus(Section):
    """A CAN bus, in the words of python-can."""

    interface: str = Field(description="python-can interface, such as socketcan")
    channel: str = Field(description="channel of the interface, such as can0")
    bitrate: Annotated[int, number(10_000, 1_000_000, "bit/s", "bit rate")] | None = None
    """Only for interfaces that set it; SocketCAN takes it from the system."""


class Lever(Section):
    """A joystick message and the switches in it."""

    bus: str = Field(description="name of the bus the message arrives on")
    message: str = Field(description="message in the DBC files")
    timeout_ms: Annotated[int, number(10, 1000, "ms", "age at which the message counts as lost")]
    enable: str = Field(description="signal of the enable switch: 1 on, 0 off, all else invalid")
    reset: str | None = Field(None, description="signal whose rising edge resets a trip")
    anti_sway_off: str | None = Field(None, description="signal that asks for the unshaped stick")
    alive_counter: str | None = Field(None, description="signal that changes with every message")


class Stick(Section):
    """Where an axis gets its command from."""

    lever: str = Field(description="name of a lever")
    signal: str = Field(description="signal with the signed velocity; its DBC range is full stick")
    neutral_pct: Annotated[
        float, number(0.1, 20, "% of full stick", "deflection that still counts as neutral")
    ] = 2.0


class Valve(Section):
    """Valve command message of an axis; its GenMsgCycleTime is the period it is sent at."""

    bus: str = Field(description="name of the bus the message is sent on")
    message: str = Field(description="message in the DBC files")
    signal: str = Field(description="signal with the signed command; its DBC range is full command")
    alive_counter: str | None = Field(None, description="signal counted up with every message")


class Status(Section):
    """A status message for displays and tools."""

    bus: str = Field(description="name of the bus the message is sent on")
    message: str = Field(description="message in the DBC files")


class Sway(Section):
    """Swing of the tool on one axis.

    Either grapple data (``length_m``, ``damping_nms``, ``mass_kg``), or what a stopwatch shows
    (``period_s`` with ``damping_ratio`` or ``decay_per_swing``).
    """

    full_speed_m_s: Annotated[
        float, number(0.05, 20, "m/s", "speed of the tip at full command, scales the sway shown")
    ]
    length_m: Annotated[float, number(0.05, 30, "m", "pendulum length")] | None = None
    damping_nms: Annotated[float, number(0, 1e6, "N m s/rad", "damping of the joint")] | None = None
    mass_kg: Annotated[float, number(1, 1e5, "kg", "mass of tool and load")] | None = None
    period_s: Annotated[float, number(0.15, 12, "s", "time of one full swing")] | None = None
    damping_ratio: Annotated[float, number(0, 0.95, "", "damping ratio")] | None = None
    decay_per_swing: (
        Annotated[float, number(0, 0.99, "", "part of the amplitude lost over a full swing")] | None
    ) = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.mode()
        return self

    def mode(self) -> SwayMode:
        """Sway mode of this data.

        Raises:
            ValueError: the data is incomplete, given twice, or makes no sense.
        """
        given = self.model_fields_set - {"full_speed_m_s"}
        if given == {"length_m", "damping_nms", "mass_kg"}:
            assert self.length_m and self.mass_kg and self.damping_nms is not None
            return SwayMode.from_grapple(self.length_m, self.damping_nms, self.mass_kg)
        if given == {"period_s", "damping_ratio"}:
            assert self.period_s and self.damping_ratio is not None
            return SwayMode.from_period(self.period_s, self.damping_ratio)
        if given == {"period_s", "decay_per_swing"}:
            assert self.period_s and self.decay_per_swing is not None
            return SwayMode.from_decay(self.period_s, self.decay_per_swing)
        raise ValueError(
            f"found {', '.join(sorted(given)) or 'no sway data'}; allowed are length_m, damping_nms"
            " and mass_kg, or period_s and damping_ratio, or period_s and decay_per_swing"
        )


class OffFilter(Section):
    """No shaping: output limits only."""

    kind: Literal["off"]


class GffFilter(Section):
    """The limit-aware G_FF, by its denominator (``a1``, ``a2``) or by its poles."""

    kind: Literal["gff"]
    a1: Annotated[float, number(1e-3, 20, "s", "coefficient a1 of the denominator")] | None = None
    a2: Annotated[float, number(1e-6, 100, "s^2", "coefficient a2 of the denominator")] | None = (
        None
    )
    poles_rad_s: (
        Annotated[
            list[Annotated[float, number(-100, -0.1, "rad/s", "pole of the filter")]],
            Field(min_length=2, max_length=2),
        ]
        | None
    ) = None

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.poles()
        return self

    def poles(self) -> tuple[float, float]:
        """Both poles, rad/s.

        Raises:
            ValueError: given twice or not at all, or the poles are not real.
        """
        given = self.model_fields_set - {"kind"}
        if given == {"a1", "a2"}:
            assert self.a1 and self.a2
            return poles_from_denominator(self.a1, self.a2)
        if given == {"poles_rad_s"}:
            assert self.poles_rad_s
            return self.poles_rad_s[0], self.poles_rad_s[1]
        raise ValueError(
            f"found {', '.join(sorted(given)) or 'neither'}; allowed are a1 and a2, or poles_rad_s"
        )


class Limits(Section):
    """Output limits of an axis; see ``OutputLimits``."""

    max_pct: Annotated[float, number(1, 100, "% of full speed", "fastest output")] = 100.0
    min_pct: Annotated[float, number(0, 50, "% of full speed", "outputs below this are zero")] = 0.0
    rise_per_s: Annotated[
        float, number(0.2, 100, "full speeds per s", "fastest growth of the output")
    ] = 5.0
    fall_per_s: Annotated[
        float, number(1, 100, "full speeds per s", "fastest fall of the output to zero")
    ] = 5.0
    deadband_pct: Annotated[
        float, number(0, 50, "% of full command", "deadband of the valve, jumped over")
    ] = 0.0
    tail_s: Annotated[
        float, number(0, 5, "s", "how long the output may stay as fast as was asked before")
    ] = 2.0
    stop_s: Annotated[
        float, number(0.1, 5, "s", "longest shaped stop after the input was lost")
    ] = 2.0
    allow_faster: bool = Field(False, description="the output may exceed what the operator asks")
    allow_reverse: bool = Field(False, description="the output may go against the lever")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min_pct >= self.max_pct:
            raise ValueError(f"min_pct is {self.min_pct:g}, allowed is below max_pct")
        return self

    def output_limits(self) -> OutputLimits:
        """The same in fractions of full scale."""
        return OutputLimits(
            maximum=self.max_pct / 100.0,
            minimum=self.min_pct / 100.0,
            rise_per_s=self.rise_per_s,
            fall_per_s=self.fall_per_s,
            deadband=self.deadband_pct / 100.0,
            tail_s=self.tail_s,
            allow_faster=self.allow_faster,
            allow_reverse=self.allow_reverse,
        )


class AxisConfig(Section):
    """One axis: from which stick, through which filter and limits, to which valve."""

    stick: Stick
    valve: Valve
    status: Status | None = None
    sway: Sway | None = None
    filter: Annotated[OffFilter | GffFilter, Field(discriminator="kind")]
    limits: Limits = Limits()

    @model_validator(mode="after")
    def _filter_has_sway(self) -> Self:
        if self.filter.kind == "gff" and self.sway is None:
            raise ValueError("filter gff needs the sway data of the axis; found no sway")
        return self


class DeploymentConfig(Section):
    """A machine: buses, DBC files, levers and axes."""

    tick_ms: Annotated[int, number(1, 50, "ms", "period of the control loop")] = 20
    buses: Annotated[dict[str, Bus], Field(min_length=1)]
    dbc: Annotated[list[str], Field(min_length=1)]
    """DBC files, relative to the deployment file."""
    levers: Annotated[dict[str, Lever], Field(min_length=1)]
    axes: Annotated[dict[str, AxisConfig], Field(min_length=1)]
    status: Status | None = None
