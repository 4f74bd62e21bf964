"""Sway sensor of an axis, as it stands in a deployment file."""

from typing import Annotated, Literal

from pydantic import Field

from canshaper.config.codes import NamedCodes
from canshaper.config.input import Input
from canshaper.config.origin import Origin
from canshaper.config.section import number
from canshaper.shaping.sway_sensor import Measured

Kind = Literal["angle", "inclination", "rate"]


class SwaySensor(NamedCodes, Input):
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
        """What it measures."""
        return Measured.RATE if self.kind == "rate" else Measured.ANGLE

    @property
    def noise(self) -> float:
        """Standard deviation, degrees or degrees per second."""
        if self.noise_deg is not None:
            return self.noise_deg
        return 0.1 if self.measured is Measured.ANGLE else 0.3
