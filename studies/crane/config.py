"""The crane's data: DH table, joint limits and grapple, read from a file such as
forwarder.yaml with the strictness of the deployment file.
"""

from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, model_validator

from canshaper.config.load import load_section
from canshaper.config.section import Section, number
from canshaper.config.source import Source
from canshaper.errors import DesignError

_Length = Annotated[float, number(-20, 20, "m", "link length a_(i-1)")]
_Twist = Annotated[float, number(-180, 180, "deg", "link twist alpha_(i-1)")]
_Offset = Annotated[float, number(-20, 20, "m", "link offset d_i")]
_Angle = Annotated[float, number(-360, 360, "deg", "joint angle theta_i")]

# Twists with which the boom lies in one vertical plane through the pillar and lifts for positive
# angles. Eq. 3 is this case; the tip's radius, height and slew angle exist only then.
_PLANE = {"slew": 0.0, "lift": 90.0, "knuckle": 0.0, "extension": -90.0}


class RotaryJoint(Section):
    """Row of the DH table whose variable is the angle, counted from ``theta_deg``."""

    a_m: _Length
    alpha_deg: _Twist
    d_m: _Offset
    theta_deg: _Angle
    min_deg: Annotated[float, number(-720, 720, "deg", "lower end stop")]
    max_deg: Annotated[float, number(-720, 720, "deg", "upper end stop")]
    full_speed_deg_s: Annotated[float, number(0.5, 180, "deg/s", "speed of the fully open valve")]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min_deg >= self.max_deg:
            raise DesignError(f"min_deg: expected less than max_deg, got {self.min_deg:g}")
        return self


class SlidingJoint(Section):
    """Row of the DH table whose variable is the length, counted from ``d_m``."""

    a_m: _Length
    alpha_deg: _Twist
    d_m: _Offset
    theta_deg: _Angle
    min_m: Annotated[float, number(0, 20, "m", "lower end stop")]
    max_m: Annotated[float, number(0, 20, "m", "upper end stop")]
    full_speed_m_s: Annotated[float, number(0.01, 5, "m/s", "speed of the fully open valve")]

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.min_m >= self.max_m:
            raise DesignError(f"min_m: expected less than max_m, got {self.min_m:g}")
        return self


class Joints(Section):
    """The driven joints from the pillar to the tip (paper Eq. 1-3).

    Row i is Craig's: a_(i-1) and alpha_(i-1) of the link before the joint, d_i and theta_i of the
    joint. Base frame: origin at the foot of the pillar, z upwards, x outwards at slew angle 0.
    """

    slew: RotaryJoint = Field(description="pillar, positive counter-clockwise seen from above")
    lift: RotaryJoint = Field(description="main boom, 0 horizontal, positive upwards")
    knuckle: RotaryJoint = Field(description="outer boom against main boom, positive upwards")
    extension: SlidingJoint = Field(description="telescope of the outer boom, positive outwards")

    @model_validator(mode="after")
    def _in_one_plane(self) -> Self:
        for name, twist in _PLANE.items():
            angle = getattr(self, name).alpha_deg
            if angle != twist:
                raise DesignError(f"{name}.alpha_deg: expected {twist:g} (Eq. 3), got {angle:g}")
        for name, value in (
            ("slew.a_m", self.slew.a_m),
            ("lift.d_m", self.lift.d_m),
            ("knuckle.d_m", self.knuckle.d_m),
            ("extension.theta_deg", self.extension.theta_deg),
        ):
            if value != 0.0:
                raise DesignError(f"{name}: expected 0 (boom in one plane, Eq. 3), got {value:g}")
        return self


class GrappleData(Section):
    """Link and grapple below the tip, both point masses, in free joints with viscous damping."""

    l1_m: Annotated[float, number(0, 2, "m", "joint of theta5 to joint of theta6")]
    l2_m: Annotated[float, number(0.1, 10, "m", "joint of theta6 to centre of mass")]
    m1_kg: Annotated[float, number(0, 10_000, "kg", "mass of the link, at the joint of theta6")]
    m2_kg: Annotated[float, number(1, 100_000, "kg", "mass of grapple and load")]
    c5_n_m_s_rad: Annotated[float, number(0, 1e6, "N m s/rad", "damping of the joint of theta5")]
    c6_n_m_s_rad: Annotated[float, number(0, 1e6, "N m s/rad", "damping of the joint of theta6")]


class CraneConfig(Section):
    """A crane: joints and grapple."""

    name: str = Field(description="what the crane is called in tables and pictures")
    joints: Joints = Field(description="the driven joints, from the pillar to the tip")
    grapple: GrappleData = Field(description="what hangs at the tip")


def load_crane(path: Path) -> tuple[CraneConfig, Source]:
    """Read and validate a crane file.

    Raises:
        ConfigError: with every problem of the file, each with its line.
    """
    return load_section(path, CraneConfig)
