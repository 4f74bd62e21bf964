"""Sway data of an axis, as it stands in a deployment file."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.origin import Origin
from canshaper.config.section import Section, number
from canshaper.shaping.sway import SwayMode


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
    origin: Origin | None = Field(None, description="where these numbers come from")

    @model_validator(mode="after")
    def _complete(self) -> Self:
        self.mode()
        return self

    def mode(self) -> SwayMode:
        """Sway mode of this data.

        Raises:
            ValueError: the data is incomplete, given twice, or makes no sense.
        """
        given = self.model_dump(exclude={"full_speed_m_s", "origin"}, exclude_none=True).keys()
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
            "expected length_m, damping_nms and mass_kg, or period_s and damping_ratio, or period_s"
            f" and decay_per_swing, got {', '.join(sorted(given)) or 'no sway data'}"
        )
