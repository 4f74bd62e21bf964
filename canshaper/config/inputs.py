"""Sections of inputs besides joysticks: switches, enables, sensors."""

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from canshaper.config.origin import Origin
from canshaper.config.protection import Protected
from canshaper.config.section import Section, number
from canshaper.shaping.sway_sensor import Measured


class InputSection(Protected):
    """A message that is received, with its age limit and its protection."""

    source: Annotated[int, number(0, 253, "", "source address of the sender, in J1939")] | None = (
        None
    )
    """J1939: address of the sender; by default that of the DBC, where FE (254) is any."""
    timeout_ms: Annotated[int, number(10, 1000, "ms", "age at which the message counts as lost")]
    """Age at which it is lost; of a joystick at least two cycles and two ticks."""
    alive_max_step: (
        Annotated[
            int, number(1, 255, "", "largest step of the alive counter that is still the next one")
        ]
        | None
    ) = None
    """Largest step that still counts as the next message, at most half of the counter's range; by
    default 3, 1 and 2 for counters of one and two bits."""
    qualify: Annotated[int, number(1, 20, "messages", "good ones in a row that are needed")] = 1
    """Good messages in a row that are needed at the start, after a wrong one and after silence."""


class SwitchSection(InputSection):
    """A switch in a message of its own: seat or door switch, button, state of another ECU."""

    signal: str = Field(description="signal of the switch")
    code: Annotated[int, number(0, 2**32, "", "raw value that agrees; no other one does")] = 1


def _as_list(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


SwitchNames = Annotated[
    list[str],
    BeforeValidator(_as_list),
    Field(min_length=1),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1},
            ]
        }
    ),
]
"""One name, or several."""


Meaning = Literal["value", "fault"]


class NamedCodes(Section):
    """A signal that is read as a number."""

    codes: dict[str, Meaning] = Field({})
    """By their names, values that the DBC names (VAL_): value for a measurement like every other
    number, fault for none, as without an entry."""


Kind = Literal["angle", "inclination", "rate"]


class SwaySensorSection(NamedCodes, InputSection):
    """Measures the swing of the tool in the plane of the axis.

    An angle is that of a joint, an inclination that of the tool against the vertical, a rate that
    of a gyro. Several axes may read the same message. An offset, noise or a largest offset is in
    degrees, of a rate in degrees per second.
    """

    node: str | None = Field(None, description="name of its node on a bus of CANopen")
    signal: str = Field(description="signal with the angle, or the rate, of the swing")
    merit: str | None = Field(
        None, description="signal of its figure of merit, as in SSI: 0 good, all else measures none"
    )
    kind: Kind = Field(description="what it measures")
    fusion_s: (
        Annotated[
            float,
            number(0, 1000, "s", "time constant with which accelerations correct its gyro"),
        ]
        | None
    ) = None
    """Time constant with which an inclinometer corrects its gyro by accelerations, of its data
    sheet; 0 without a gyro."""
    use: Literal["watch", "damp"] = Field(
        "watch", description="say whether it can be trusted, or damp the swing by it too"
    )
    invert: bool = Field(
        False, description="a tip that speeds up in positive direction makes it negative"
    )
    delay_ms: Annotated[
        float, number(0, 500, "ms", "age of a measurement when its frame arrives")
    ] = 20.0
    valve_lag_ms: Annotated[
        float, number(0, 1000, "ms", "time constant from the valve's command to the tip's speed")
    ] = 100.0
    noise_deg: Annotated[float, number(0.01, 5, "deg, deg/s", "standard deviation")] | None = None
    """Standard deviation of its noise; by default 0.1 degrees, or 0.3 degrees per second."""
    offset_max_deg: Annotated[float, number(0.1, 20, "deg, deg/s", "largest offset")] = 3.0
    length_range_pct: Annotated[
        float,
        number(5, 300, "%", "most that the pendulum seems longer, or shorter"),
    ] = 60.0
    second_period_s: (
        Annotated[float, number(0.15, 3, "s", "period of a second swing that is left alone")] | None
    ) = None
    """Period of a second, quicker swing that it shows too, such as that of long logs: kept apart
    from the first one, and not damped."""
    origin: Origin | None = Field(None, description="where sign, delay, offset and noise come from")

    @property
    def measured(self) -> Measured:
        """Quantity that it measures."""
        return Measured.RATE if self.kind == "rate" else Measured.ANGLE

    @property
    def noise(self) -> float:
        """Standard deviation, degrees or degrees per second."""
        if self.noise_deg is not None:
            return self.noise_deg
        return 0.1 if self.measured is Measured.ANGLE else 0.3
