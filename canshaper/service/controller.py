"""The controller: frames in, frames out, without sockets and without a clock.

The same object runs in the daemon, in lock-step simulation and in replay of a log.
"""

import math
from dataclasses import dataclass

from canshaper.can.binding import BoundAxis, Deployment
from canshaper.can.frame import Frame, FrameFault
from canshaper.config.schema import GffFilter
from canshaper.service.lever import LeverInput
from canshaper.shaping.axis import Axis, Transition
from canshaper.shaping.gff import Gff
from canshaper.shaping.registry import Off, Shaper
from canshaper.shaping.states import Reason
from canshaper.shaping.sway import SwayModel


@dataclass(frozen=True, slots=True)
class Event:
    """Something an administrator wants to read: a change of state of an axis."""

    axis: str
    transition: Transition


class Counters:
    """What went wrong so far, by the signal names of the status message."""

    __slots__ = ("last_fault", "values")

    SIGNAL_OF = {  # noqa: RUF012  (a constant table)
        FrameFault.WRONG_LENGTH: "WrongLength",
        FrameFault.UNKNOWN_ID: "UnknownId",
        FrameFault.ERROR_FRAME: "ErrorFrames",
        FrameFault.INVALID_SIGNAL: "InvalidSignals",
        FrameFault.SEND_FAILED: "SendFailures",
        FrameFault.MISSED_DEADLINE: "MissedDeadlines",
    }

    def __init__(self) -> None:
        self.values = dict.fromkeys(self.SIGNAL_OF.values(), 0)
        self.last_fault = FrameFault.NONE

    def add(self, fault: FrameFault, count: int = 1) -> None:
        """Count a fault and remember it as the last one."""
        self.last_fault = fault
        signal = self.SIGNAL_OF.get(fault)
        if signal is not None:
            self.values[signal] += count

    def status(self) -> dict[str, int]:
        """Values of the status message."""
        return {**self.values, "LastFault": int(self.last_fault)}


class AxisRunner:
    """One axis with its codecs: when it is due, what it sends."""

    def __init__(self, bound: BoundAxis, tick_s: float, lever: LeverInput) -> None:
        config = bound.config
        self.bound = bound
        self._lever = lever
        self._signal = config.stick.signal
        period_s = tick_s * bound.period_ticks
        sway = SwayModel(config.sway.mode(), period_s) if config.sway else None
        self.axis = Axis(
            period_s,
            config.limits.output_limits(),
            sway=sway,
            shaper=build_shaper(bound, sway),
            neutral_band=config.stick.neutral_pct / 100.0,
            stop_s=config.limits.stop_s,
            grid_steps=bound.valve.steps,
        )
        self._sway_deg = 0.0
        if config.sway:
            model = config.sway.mode().angle_per_speed_rad
            self._sway_deg = math.degrees(model * config.sway.full_speed_m_s)
        self.trip: Reason | None = None

    def tick(self, now_ns: int) -> Transition | None:
        """One step of the axis; a trip cause noted since the last one acts now."""
        stick = self._lever.stick(self._signal, now_ns, self.trip)
        self.trip = None
        return self.axis.tick(stick)

    def valve_frame(self) -> Frame:
        """The frame for what the axis sends now."""
        return self.bound.valve.frame(self.axis.raw)

    def status_frame(self) -> Frame | None:
        """Status of the axis, where it has a message for it."""
        if self.bound.status is None:
            return None
        axis = self.axis
        sway_deg = axis.sway.angle * self._sway_deg if axis.sway else 0.0
        return self.bound.status.frame(axis.state, axis.reason, axis.command, axis.sent, sway_deg)


class Controller:
    """All axes of a deployment.

    Attributes:
        counters: what went wrong so far.
        events: changes of state since the owner last emptied the list.
    """

    def __init__(self, deployment: Deployment) -> None:
        self.deployment = deployment
        self.counters = Counters()
        self.events: list[Event] = []
        levers = {name: LeverInput(lever) for name, lever in deployment.levers.items()}
        self._inputs = {lever.key: levers[name] for name, lever in deployment.levers.items()}
        tick_s = deployment.config.tick_ms / 1000.0
        self.axes = {
            name: AxisRunner(bound, tick_s, levers[bound.config.stick.lever])
            for name, bound in deployment.axes.items()
        }
        self._by_message = {
            (a.bound.config.valve.bus, a.bound.valve_message.frame_id): a
            for a in self.axes.values()
        }
        self._ticks = 0

    @property
    def neutral(self) -> bool:
        """Whether no axis can move without the operator."""
        return all(runner.axis.neutral for runner in self.axes.values())

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame from a bus; ``now_ns`` is the monotonic time of its reception."""
        lever = self._inputs.get((frame.bus, frame.can_id, frame.extended))
        fault = FrameFault.UNKNOWN_ID if lever is None else lever.receive(frame.data, now_ns)
        if fault:
            self.counters.add(fault)

    def tick(self, now_ns: int, missed: int = 0) -> list[Frame]:
        """Run every axis that is due.

        Args:
            now_ns: monotonic time of this tick.
            missed: deadlines missed since the last tick; the last output was held meanwhile.

        Returns:
            The frames to send now, valve frames first. A frame that could not be sent is to be
            told to ``send_failed``, and never sent later.
        """
        frames: list[Frame] = []
        status: list[Frame] = []
        ticks = self._ticks
        if missed:
            self.counters.add(FrameFault.MISSED_DEADLINE, missed)
        for name, runner in self.axes.items():
            if ticks % runner.bound.period_ticks == 0:
                if missed:
                    runner.axis.hold(missed // runner.bound.period_ticks)
                transition = runner.tick(now_ns)
                frames.append(runner.valve_frame())
                if transition is not None:
                    self.events.append(Event(name, transition))
                due = transition is not None or ticks % (runner.bound.status_ticks or 1) == 0
                if due and (frame := runner.status_frame()):
                    status.append(frame)
        if self.deployment.status and ticks % self.deployment.status_ticks == 0:
            status.append(self.deployment.status.frame(self.counters.status()))
        self._ticks = ticks + 1
        return frames + status

    def stalled(self) -> None:
        """The loop stood still for longer than any input may be old: nothing known still holds."""
        for lever in self._inputs.values():
            lever.forget()
        for runner in self.axes.values():
            if not runner.axis.neutral:
                runner.trip = Reason.LOOP_STALLED

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus; the axis of a valve frame trips."""
        self.counters.add(FrameFault.SEND_FAILED)
        runner = self._by_message.get((frame.bus, frame.can_id))
        if runner is not None and not runner.axis.neutral:
            runner.trip = Reason.SEND_FAILED

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve: the last thing sent."""
        return [runner.bound.valve.frame(0) for runner in self.axes.values()]


def build_shaper(bound: BoundAxis, sway: SwayModel | None) -> Shaper:
    """The filter that the deployment file names."""
    config = bound.config.filter
    if isinstance(config, GffFilter):
        assert sway is not None  # the schema asks for it
        return Gff(sway, config.poles())
    return Off()
