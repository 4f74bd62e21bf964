"""Axes of a crane move coordinates of its tip, its trolley or its joints: which one moves which."""

from collections.abc import Iterable, Mapping
from typing import Annotated, Final, Literal

from pydantic import Field

from canshaper.config.section import Section, number


class _Crane(Section):
    simulated: dict[str, Annotated[float, number(-1e6, 1e6, "", "its value")]] = Field(
        {}, description="simulated crane: its parameters by the names of `sim --show`"
    )

    @property
    def moved(self) -> dict[str, str]:
        """Axis by the coordinate that it moves."""
        return self.model_dump(exclude={"kind", "simulated"}, exclude_none=True)


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
    bridge: str | None = Field(None, description="axis that moves the bridge along its runway")
    trolley: str | None = Field(None, description="axis that moves the trolley along the bridge")
    hoist: str | None = Field(None, description="axis of the rope, positive up")


class JointCrane(_Crane):
    """A boom whose joints have an axis each."""

    kind: Literal["joints"] = Field(description="an axis for each joint of the boom")
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
    """Return the coordinate that each axis moves, by its name; those that move none are not in it.

    Args:
        crane: what the file says; without it the names of the axes say it.
        axes: their names.
    """
    if crane is None:
        return {name: name for name in axes if name in _BY_NAME}
    by_axis = {axis: coordinate for coordinate, axis in crane.moved.items()}
    return {name: by_axis[name] for name in axes if name in by_axis}
