"""The radial compensation that a slewing axis asks of the near-far axis."""

import math
from typing import TYPE_CHECKING

from canshaper.config.schema import RadialConfig
from canshaper.inputs.radius import RadiusInput
from canshaper.shaping.added import AddedBounds
from canshaper.shaping.axis import Axis
from canshaper.shaping.radial import RadialCompensation
from canshaper.shaping.states import State
from canshaper.shaping.sway import SwayModel

if TYPE_CHECKING:
    from canshaper.controller.runner import AxisRunner


class Compensator:
    """Radial compensation from a slew axis to its near-far axis.

    It does not know the runner that has it: a cycle would outlive a reload, see ``Collector``.

    Args:
        slew: the axis that slews.
        radial: its compensation.
        near_far: the axis that moves the tip in and out.
        radius: where the radius of the tip comes from.
    """

    def __init__(
        self, slew: Axis, radial: RadialConfig, near_far: "AxisRunner", radius: RadiusInput
    ) -> None:
        self._slew = slew
        self._config = radial
        self._near_far = near_far
        self._radius = radius
        self._share = 1.0
        self._bounds = AddedBounds(
            near_far.period_s,
            largest=radial.max_pct / 100.0,
            path_s=math.inf,
            time_s=radial.max_s,
            least=0.5 / near_far.bound.valve.steps,
        )
        near_far.axis.bound_added(self._bounds)
        self.adjust()

    def adjust(self) -> None:
        """Take the sway data of the near-far axis as it is now."""
        radial, sway = self._config, self._near_far.bound.config.sway
        assert sway is not None  # checked with the deployment
        self._radial = RadialCompensation(
            sway.mode(),
            radial.full_speed_rad_s,
            sway.full_speed_m_s,
            radial.max_pct / 100.0,
        )
        self._bounds.limit_path(radial.max_path_m / sway.full_speed_m_s)

    def before_slew(self) -> float:
        """What the slew axis is to add in this tick."""
        sway, applied = self._sway(), self._slew.applied
        self._share = self._radial.tip_share(sway, applied)
        return self._radial.slew(sway, applied) if self._moving() else 0.0

    def after_slew(self, now_ns: int) -> None:
        """Tell the near-far axis what to add in this tick, in which the slew axis has moved."""
        added = 0.0
        if self._moving():
            sway = self._sway()
            share = self._radial.tip_share(sway, self._slew.applied)
            circle_m = self._radius.circle_m(now_ns, share)
            if circle_m is not None:
                added = self._radial.near_far(self._share, share, circle_m, sway.tick_s)
        elif self._slew.state is State.TRIPPED:
            self._near_far.axis.drop_added()
        self._near_far.add(added)
        if not self._slew.commanded:
            self._bounds.begin()

    def _sway(self) -> SwayModel:
        """Sway model of the slew axis now; a change of its sway data makes another one."""
        sway = self._slew.sway
        assert sway is not None  # checked with the deployment
        return sway

    def _moving(self) -> bool:
        """While the slew joystick is valid and enabled, and at most for the tail after release.

        Not for ever after a swing that nobody damps: nothing may move without an operator.
        """
        return self._slew.commanded and self._slew.state is State.ACTIVE
