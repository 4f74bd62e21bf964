"""Sway sensor of an axis, as it stands in a deployment file."""

from typing import Annotated, Literal

from pydantic import Field

from canshaper.config.input import Input
from canshaper.config.section import number
from canshaper.shaping.observer import Measured


class SwaySensor(Input):
    """Measures the swing of the tool in the plane of the axis.

    Angles are those of a joint, or against the vertical; rates those of a gyro. Several axes may
    read the same message. An offset, noise or a largest offset is in degrees, of a rate in degrees
    per second.
    """

    signal: str = Field(description="signal with the angle, or the rate, of the swing")
    kind: Literal["angle", "rate"] = Field(description="what it measures")
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

    @property
    def measured(self) -> Measured:
        """What it measures."""
        return Measured(self.kind)

    @property
    def noise(self) -> float:
        """Standard deviation, degrees or degrees per second."""
        if self.noise_deg is not None:
            return self.noise_deg
        return 0.1 if self.measured is Measured.ANGLE else 0.3
