"""Slew and near-far of a crane as one motion."""

from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.codes import NamedCodes
from canshaper.config.input import Input
from canshaper.config.section import Section, number


class Radius(NamedCodes, Input):
    """Radius of the tip, measured."""

    signal: str = Field(description="signal with the radius in m")
    timeout_ms: Annotated[int, number(10, 5000, "ms", "age at which it counts as lost")]
    """Age at which it counts as lost. In a motion a lost radius is carried on by the model of
    near-far, and a jump is followed within a second."""


class Motion(Section):
    """What the axes of a crane add for each other, see ``TwoAxisMotion``.

    Without a radius, or without a near-far axis, slew gets what needs neither.
    """

    slew: str = Field(description="the axis that turns; it needs sway and slewing")
    near_far: str | None = None
    """The axis that moves the tip in and out; it needs sway. Without it slew gets what needs no
    radius. A single joint of the boom is none."""
    radius: Radius | None = None
    """Radius of the tip, where it is measured."""
    radius_m: Annotated[float, number(0.5, 30, "m", "radius of the grapple")] | None = None
    """Instead: radius of the grapple, where it hardly changes."""
    max_pct: Annotated[
        float,
        number(1, 50, "% of full speed", "fastest motion of an axis that its operator left alone"),
    ] = 25.0
    max_path_m: Annotated[
        float, number(0.02, 2, "m", "farthest that near-far is moved in or out")
    ] = 0.3
    """Farthest that near-far is moved in or out; as far again where its sway sensor damps."""
    max_s: Annotated[
        float, number(0.5, 60, "s", "longest motion of an axis that its operator left alone")
    ] = 6.0

    @model_validator(mode="after")
    def _one_radius(self) -> Self:
        if self.radius and self.radius_m:
            raise ValueError("expected one of radius and radius_m, got both")
        if self.near_far is None and (self.radius or self.radius_m):
            raise ValueError("expected near_far with a radius, got none")
        return self
