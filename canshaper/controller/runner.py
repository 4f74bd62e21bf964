"""One axis of a deployment at work, and the compensation that one axis asks of another."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Protocol, Self

from canshaper.codec.frame import Frame
from canshaper.config.schema import AxisConfig, RadialConfig
from canshaper.controller.sets import SetChooser
from canshaper.inputs.feedback import Feedback
from canshaper.inputs.input import EmergencyStopInput
from canshaper.inputs.radius import RadiusInput
from canshaper.machine.deployment import BoundAxis
from canshaper.protocols.canopen.cia408 import ValveControl
from canshaper.shaping.added import AddedBounds
from canshaper.shaping.axis import Axis
from canshaper.shaping.radial import RadialCompensation
from canshaper.shaping.registry import build_shaper
from canshaper.shaping.states import Reason, State, StickInput, Transition
from canshaper.shaping.sway import SwayModel

# How long another sender must be silent before a trip for it can be reset: ten periods of a slow
# valve message.
CONTESTED_NS = 1_000_000_000
# Called with whether the axis is neutral, and the time; why it may not move, or None.
Gate = Callable[[bool, int], Reason | None]
# Reasons from here on are for neutral at once.
TRIPS = Reason.ENABLE_LOST


class StickSource(Protocol):
    """Where an axis gets its stick from."""

    def stick(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> StickInput:
        """What the axis may use now, see ``LeverInput``."""

    @property
    def releases(self) -> int:
        """How often its enable was seen released."""


class AxisRunner:
    """One axis with its codecs: when it is due, what it sends.

    Attributes:
        bound: the axis with its codecs, and with the configuration that is in force.
        period_ticks, period_s: time between two commands to its valve.
        trip: a cause for neutral at once, noted since the last tick.
        lost: the input was lost since the last tick, though it may be back: neutral comes first.
        contested_ns: when the last frame of another sender with the id of this valve arrived.
        added: velocity that another axis asks of this one, fraction of full speed.
        control: the state machine of its valve, where that is one of CiA 408.
        feedback: what the valve says of itself, where it does.
        chooser: which sway data and filter are in force, where there is a choice.
        gates: what else has to agree before the axis may move.
        compensator: what this axis asks of another one, where it slews.
    """

    def __init__(self, bound: BoundAxis, tick_s: float, lever: StickSource) -> None:
        config = bound.config
        self.bound = bound
        self._lever = lever
        self._releases = self._presses = 0  # as this axis knows them
        self._signal = config.stick.signal
        self._neutral_band = config.stick.neutral_pct / 100.0
        self.period_ticks = bound.period_ticks
        self.period_s = period_s = tick_s * bound.period_ticks
        sway = SwayModel(config.sway.mode(), period_s) if config.sway else None
        self.axis = Axis(
            period_s,
            config.limits.output_limits(),
            sway=sway,
            shaper=build_shaper(
                config.filter.kind,
                period_s,
                sway,
                valve_rate_per_s=config.limits.slowest_per_s,
                **config.filter.parameters(),
            ),
            neutral_band=self._neutral_band,
            stop_s=config.limits.stop_s,
            grid_steps=bound.valve.steps,
        )
        self._full_speed_m_s = config.sway.full_speed_m_s if config.sway else 0.0
        self.trip: Reason | None = None
        self.lost = False
        self.contested_ns: int | None = None
        self.added = 0.0
        self.gates: list[Gate] = []
        self.chooser: SetChooser | None = None
        self.feedback = Feedback(bound.feedback, period_s) if bound.feedback else None
        self.control: ValveControl | None = None
        if bound.status_word and config.valve.cia408:
            control = config.valve.cia408.control
            self.control = ValveControl(bound.status_word, control, bound.valve.message)
            self.gates.append(self.control.gate)
        self.compensator: Compensator | None = None

    def contest(self, arrived_ns: int) -> None:
        """Another sender has sent the id of this valve: neutral at once, however long ago."""
        self.trip = self.trip or Reason.SECOND_SENDER
        self.contested_ns = arrived_ns

    def see(self, emergency: EmergencyStopInput) -> None:
        """Trip for a press that came since the last tick, though it may be over by now."""
        if emergency.presses != self._presses:
            self.trip = self.trip or Reason.EMERGENCY_STOP

    def copy_state(self, before: Self) -> None:
        """Stay latched, and trip for what the same axis has not acted on: a reload is no reset.

        Of a lost address it is the way back.
        """
        latched = before.axis
        if latched.state is State.TRIPPED and latched.reason is not Reason.ADDRESS_LOST:
            self.axis.state, self.axis.reason = latched.state, latched.reason
        self.trip = before.trip or self.trip
        self.contested_ns = before.contested_ns or self.contested_ns

    def replace_lever(self, lever: StickSource) -> None:
        """Take the stick from somewhere else."""
        self._lever = lever

    def adjust(self, config: AxisConfig) -> None:
        """Go on with another configuration of sway, filter and limits, all else as before.

        Args:
            config: one whose filter runs at this period; with other limits only in neutral.
        """
        limits = config.limits
        if limits != self.bound.config.limits:
            self.axis.limit(limits.output_limits())
        if config.sway is not None:
            self.axis.retune(
                config.sway.mode(),
                lambda sway: build_shaper(
                    config.filter.kind,
                    self.period_s,
                    sway,
                    valve_rate_per_s=limits.slowest_per_s,
                    **config.filter.parameters(),
                ),
            )
            self._full_speed_m_s = config.sway.full_speed_m_s
        self.bound = replace(self.bound, config=config)

    def tick(
        self, now_ns: int, emergency: EmergencyStopInput | None, overrun: bool
    ) -> Transition | None:
        """One step of the axis; a trip cause noted since the last one acts now.

        ``settle`` has to follow, before another axis moves.

        Args:
            now_ns: monotonic time.
            emergency: the emergency stop, where there is one.
            overrun: too many deadlines were missed lately.
        """
        fault = None
        if emergency or self.gates or self.lost or self.contested_ns is not None:
            fault = self._objections(now_ns, emergency)
        trip, self.trip = self.trip, None
        stick = self._lever.stick(self._signal, now_ns, self._releases, trip, self._neutral_band)
        self._releases = self._lever.releases
        # A release is more than a fault.
        if fault is not None and (stick.enabled or self.axis.neutral):
            stick = StickInput(fault=fault, reset=stick.reset, trip=trip)
        # Late ticks spoil a filter; in bypass there is none, and the driver keeps the axis.
        overrun = overrun and self.axis.state is not State.BYPASS_ON
        if overrun and stick.enabled and stick.fault is None:
            stick = StickInput(fault=Reason.LOOP_OVERRUN, reset=stick.reset, trip=stick.trip)
        if self.chooser is not None:
            self.chooser.update(now_ns)
        if self.compensator is not None:
            self.added = self.compensator.before_slew()
        transition = self.axis.act(stick, self.added)
        self.bound.valve.put(self.axis.raw)
        return transition

    def settle(self, now_ns: int) -> None:
        """What can wait until the valve was told: the model, and what is asked of another axis."""
        self.axis.advance()
        if self.compensator is not None:
            self.compensator.after_slew(now_ns)

    def _objections(self, now_ns: int, emergency: EmergencyStopInput | None) -> Reason | None:
        """Why the axis has to stop or may not begin; why it has to be neutral at once is noted."""
        trip = self.trip
        if self.contested_ns is not None:
            if now_ns - self.contested_ns <= CONTESTED_NS:
                trip = trip or Reason.SECOND_SENDER
            else:
                self.contested_ns = None
        neutral, fault = self.axis.neutral, None
        for gate in self.gates:
            found = gate(neutral, now_ns)
            if found is not None and found >= TRIPS:
                trip = trip or found
            else:
                fault = fault or found
        if emergency is not None:
            stop = emergency.stop(now_ns, self._presses)
            self._presses = emergency.presses
            if stop is Reason.EMERGENCY_STOP or (stop and not neutral):
                trip = trip or stop
            else:  # not heard of yet: nothing to trip, but nothing may begin
                fault = fault or stop
        if self.lost:
            self.lost = False
            fault = fault or Reason.STICK_TIMEOUT
        self.trip = trip
        return fault

    def status_frame(self) -> Frame | None:
        """Status of the axis, where it has a message for it."""
        if self.bound.status is None:
            return None
        axis = self.axis
        sway_rad = axis.sway.sway_rad(self._full_speed_m_s) if axis.sway else 0.0
        sway_deg = math.degrees(sway_rad)
        number = self.chooser.number if self.chooser else 0
        return self.bound.status.frame(
            axis.state, axis.reason, axis.command, axis.sent, sway_deg, active_set=number
        )


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
        self, slew: Axis, radial: RadialConfig, near_far: AxisRunner, radius: RadiusInput
    ) -> None:
        self._slew = slew
        self._config = radial
        self._near_far = near_far
        self._radius = radius
        self._share = 1.0
        near_far.axis.bounds = self._bounds = AddedBounds(
            near_far.period_s,
            largest=radial.max_pct / 100.0,
            path_s=math.inf,
            time_s=radial.max_s,
            least=0.5 / near_far.bound.valve.steps,
        )
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
        self._bounds.path_s = radial.max_path_m / sway.full_speed_m_s

    def before_slew(self) -> float:
        """What the slew axis is to add in this tick."""
        sway, told = self._sway(), self._slew.told
        self._share = self._radial.tip_share(sway, told)
        return self._radial.slew(sway, told) if self._moving() else 0.0

    def after_slew(self, now_ns: int) -> None:
        """Tell the near-far axis what to add in this tick, in which the slew axis has moved."""
        self._near_far.added = 0.0
        if self._moving():
            sway = self._sway()
            share = self._radial.tip_share(sway, self._slew.told)
            circle_m = self._radius.circle_m(now_ns, share)
            if circle_m is not None:
                added = self._radial.near_far(self._share, share, circle_m, sway.tick_s)
                self._near_far.added = added
        elif self._slew.state is State.TRIPPED:
            self._near_far.axis.drop_added()
        if not self._slew.asked:
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
        return self._slew.asked and self._slew.state is State.ACTIVE
