"""Sections of a crane: which coordinate each axis moves, and two axes as one motion."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from canshaper.config.inputs import Status
from canshaper.config.limits import Position
from canshaper.config.section import Section, number


class _Crane(Section):
    simulated: dict[str, Annotated[float, number(-1e6, 1e6, "", "its value")]] = Field(
        {}, description="simulated crane: its parameters by the names of `sim --show`"
    )

    @property
    def moved(self) -> dict[str, str]:
        """Name of the axis that moves each coordinate, by coordinate."""
        return self.model_dump(exclude={"kind", "drawn", "simulated"}, exclude_none=True)


class CylindricalCrane(_Crane):
    """A tip that turns about a pillar, goes out and in, up and down."""

    kind: Literal["cylindrical"] = Field(description="the tip about a pillar")
    slew: str | None = Field(None, description="axis that turns, positive counter-clockwise")
    near_far: str | None = Field(None, description="axis that moves the tip out, or a trolley")
    lift: str | None = Field(None, description="axis that moves the tip up")
    hoist: str | None = Field(None, description="axis of a rope from it, positive up")


class CartesianCrane(_Crane):
    """A trolley on a bridge: the load hangs from a rope, each axis moves it along a straight."""

    kind: Literal["cartesian"] = Field(description="a trolley on a bridge")
    drawn: Literal["multicopter"] | None = Field(None, description="what a page draws instead")
    bridge: str | None = Field(None, description="axis that moves the bridge along its runway")
    trolley: str | None = Field(None, description="axis that moves the trolley along the bridge")
    hoist: str | None = Field(None, description="axis of the rope, positive up")


class JointCrane(_Crane):
    """A boom whose joints have an axis each."""

    kind: Literal["joints"] = Field(description="an axis for each joint of the boom")
    drawn: Literal["excavator"] | None = Field(None, description="what a page draws instead")
    slew: str | None = Field(None, description="axis that turns, positive counter-clockwise")
    lift_cylinder: str | None = Field(None, description="axis that raises the main boom")
    knuckle: str | None = Field(None, description="axis that folds the outer boom out")
    extension: str | None = Field(None, description="axis that moves the telescope out")
    hoist: str | None = Field(None, description="axis of a rope from its tip, positive up")


CraneSection = Annotated[
    CylindricalCrane | CartesianCrane | JointCrane, Field(discriminator="kind")
]
# Coordinates that an axis of the same name moves where a file has no section.
_BY_NAME: Final = ("slew", "near_far", "lift", "lift_cylinder", "knuckle", "extension")


def coordinates(
    crane: CylindricalCrane | CartesianCrane | JointCrane | None, axes: Iterable[str]
) -> Mapping[str, str]:
    """Return the coordinate that each axis moves, by axis; axes that move none are left out.

    Args:
        crane: section of the file; without one, an axis named as a coordinate moves that.
        axes: names of the axes.
    """
    if crane is None:
        return {name: name for name in axes if name in _BY_NAME}
    by_axis = {axis: coordinate for coordinate, axis in crane.moved.items()}
    return {name: by_axis[name] for name in axes if name in by_axis}


class Radius(Position):
    """Radius of the tip, measured."""

    signal: str = Field(description="signal with the radius in m")
    timeout_ms: Annotated[int, number(10, 5000, "ms", "age at which it counts as lost")]
    """Age at which it counts as lost. In a motion a lost radius is carried on by the model of
    near-far, and a jump is followed within a second."""


class Motion(Section):
    """Two-axis motion: each of two axes adds velocities for the other's sway (``TwoAxisMotion``).

    Without a radius or a near-far axis, slew adds only the terms that need neither.
    """

    slew: str = Field(description="the axis that turns; it needs sway and slewing")
    near_far: str | None = None
    """The axis that moves the tip in and out; it needs sway. Without it slew adds only what needs
    no radius. A single joint of the boom does not qualify."""
    radius: Radius | None = None
    """Radius of the tip, where it is measured."""
    radius_m: Annotated[float, number(0.5, 120, "m", "radius of the grapple")] | None = None
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
    luffing: str | None = None
    """The joint that raises the boom and so moves the tip in; it needs sway, whose full_speed_m_s
    is that of the tip inwards. It adds to its own commands only."""
    luffing_rad_s: Annotated[float, number(0.01, 3, "rad/s", "its full speed")] | None = None
    aim: Status | None = None
    """Message with how far the tip still travels if the joysticks are released now."""
    waits: bool = Field(False, description="as if it were not there; commission takes this out")
    """Disables the motion on the first day; the step motion of commission removes this key."""

    @model_validator(mode="after")
    def _one_radius(self) -> Self:
        if self.radius and self.radius_m:
            raise ValueError("expected one of radius and radius_m, got both")
        measured = self.radius or self.radius_m
        if self.near_far is None and (self.aim or (measured and not self.luffing)):
            raise ValueError("expected near_far with a radius or an aim, got none")
        if bool(self.luffing) != bool(self.luffing_rad_s) or (self.luffing and not measured):
            raise ValueError("expected luffing, luffing_rad_s and a radius together, got a part")
        return self
