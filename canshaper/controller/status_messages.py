"""Status messages of axes, aim points and service; events of the sway sensors."""

import math
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING

from canshaper.codec.frame import Frame, MessageKey
from canshaper.codec.message import Sender
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.events import SwaySensorEvent, SwingLengthEvent
from canshaper.controller.valve_messages import Counters
from canshaper.machine.deployment import BoundMotion, Deployment
from canshaper.shaping.demand_bounds import RunOn
from canshaper.shaping.states import State, Trust
from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode

if TYPE_CHECKING:
    from canshaper.shaping.swing_length import SwingLength


# Lag of a usual proportional valve; an error of a fifth moves the aim of a tip of 1 m/s by 2 cm.
VALVE_LAG_S = 0.1
# States in which the filter lets an axis run on.
SHAPED = (State.ACTIVE, State.STOPPING)


class AimPoint:
    """Travel of a crane's tip that is still to come if its joysticks are released now.

    It is the sum of the run-on of the filters, the lag of the valves, and the way back of what the
    two-axis motion has added. It is not known while a filter still holds demands of both
    directions, for as long as its response after a reversal, nor while an axis has another
    parameter set than its own.

    Args:
        bound: the two-axis motion; it has a message for the aim point.
        axes: axes of the machine by name.

    Attributes:
        codec, ticks: codec of the message, and the ticks from one message to the next.
        slew_deg: angle that the crane still turns, degrees; 0 while it is not known.
        radius_m: way of the tip out (positive) or in, m; 0 while it is not known.
        known: whether both are known.
    """

    def __init__(self, bound: BoundMotion, axes: Mapping[str, AxisControl]) -> None:
        assert bound.aim and bound.config.near_far  # checked with the deployment
        self.codec, self.ticks = bound.aim, bound.aim_ticks
        self._slew, self._near_far = axes[bound.config.slew], axes[bound.config.near_far]
        self._run_on = self._slew.follow_run_on(), self._near_far.follow_run_on()
        self.slew_deg = self.radius_m = 0.0
        self.known = True

    def update(self) -> None:
        """Compute the aim point from the present state of both axes."""
        slew, near_far = map(_travel, (self._slew, self._near_far), self._run_on)
        slewing, sway = self._slew.bound.config.slewing, self._near_far.bound.config.sway
        assert slewing and sway  # checked with the deployment
        self.slew_deg = math.degrees((slew or 0.0) * slewing.full_speed_rad_s)
        self.radius_m = (near_far or 0.0) * sway.full_speed_m_s
        self.known = slew is not None and near_far is not None


def _travel(control: AxisControl, run_on: RunOn) -> float | None:
    """Return the travel after a release, full speed times seconds; None if it is not known."""
    back, ahead = 0.0, 0.0
    if control.axis.state in SHAPED:
        back, ahead = run_on.travel()
    if (back and ahead) or control.active_set:
        return None
    return back + ahead + VALVE_LAG_S * control.axis.output.setpoint - control.displaced


class StatusMessages:
    """All status messages of a machine.

    Args:
        deployment: the machine.
        axes: its axes by name.
        senders: senders of its messages.

    Attributes:
        aims: the aim points that are sent.
    """

    def __init__(
        self,
        deployment: Deployment,
        axes: Mapping[str, AxisControl],
        senders: Mapping[MessageKey, Sender],
    ) -> None:
        self._deployment, self._senders = deployment, senders
        self._axes = [
            (one, one.bound.status_ticks, status, senders[status.message.key])
            for one in axes.values()
            if (status := one.bound.status)
        ]
        motions = deployment.motions.values()
        self.aims = [AimPoint(motion, axes) for motion in motions if motion.aim]

    def frames(
        self, changed: Collection[AxisControl], counters: Counters, last: int, now: int
    ) -> Iterator[Frame]:
        """Yield the status of axes that have changed or are due, of aim points, of the service.

        Args:
            changed: axes whose state has just changed.
            counters: counts for the status of the service.
            last: number of the deadline of the tick before.
            now: number of this one.
        """
        for control, ticks, status, sender in self._axes:
            if control in changed or now // ticks > last // ticks:
                yield sender.frame(status.values(control))
        for aim in self.aims:
            if now // aim.ticks > last // aim.ticks:
                aim.update()
                yield self._senders[aim.codec.message.key].frame(aim.codec.values(aim))
        service, ticks = self._deployment.status, self._deployment.status_ticks
        if service and now // ticks > last // ticks:
            yield self._senders[service.message.key].frame(service.values(counters.status()))

    def identity(self, silent: frozenset[str]) -> Frame | None:
        """Return the digest of what runs; None without a message for it, or on a silent bus."""
        status = self._deployment.identity_status
        if not status or status.message.key[0] in silent:
            return None
        values = status.values(self._deployment.identity.digest)
        return self._senders[status.message.key].frame(values)


# A length that differs by this factor from the one that was reported last is reported.
LENGTH_NEWS = 1.1


class SensorReport:
    """Reports changes of the sway sensor of one axis: its trust state, the pendulum length.

    Args:
        name: name of the axis.
        control: the axis.
    """

    def __init__(self, name: str, control: AxisControl) -> None:
        self._name, self._control = name, control
        self._trust = Trust.NO_DATA
        self._length: SwingLength | None = None
        self._reported_m = 0.0

    def events(self) -> Iterator[SwaySensorEvent | SwingLengthEvent]:
        """Yield changes since the last call: of trust in the sensor, of the length by a tenth."""
        trust = self._control.trust
        if trust is not self._trust:
            self._trust = trust
            yield SwaySensorEvent(self._name, trust)
        sensed = self._control.axis.sensed
        if sensed is not None and (length := sensed.length.result) is not self._length:
            assert length is not None  # one that was measured stays
            self._length = length
            sway = self._control.bound.config.sway
            assert sway is not None  # checked with the deployment
            if self._is_news(length, sway.mode()):
                yield SwingLengthEvent(self._name, length, sway)

    def _is_news(self, length: "SwingLength", mode: SwayMode) -> bool:
        """Return whether the length differs by a tenth from the last reported, at first the file's.

        With the parameter set of a load nothing is news: the report would name a key of the file
        that is not in force.
        """
        model = self._control.axis.sway
        assert model is not None  # of an axis with a sensor
        if model.mode != mode:
            return False
        file_m = GRAVITY_M_S2 / mode.omega_rad_s**2
        ratio = length.length_m / (self._reported_m or file_m)
        if 1.0 / LENGTH_NEWS <= ratio <= LENGTH_NEWS:
            return False
        self._reported_m = length.length_m
        return True
