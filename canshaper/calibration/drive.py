"""Drives one axis through a ramp with the daemon's own controller, and listens to its speed.

Everything that may stop the daemon stops this too: enable, timeouts, emergency stop, a second
sender. The stick has to stay in neutral; moving it ends the measurement.
"""

import statistics
from collections.abc import Iterator
from typing import Any

from canshaper.calibration.fit import Calibration, CalibrationError, Sample, fit
from canshaper.calibration.ramp import Ramp
from canshaper.can.deployment import Deployment
from canshaper.can.frame import Frame
from canshaper.can.j1939 import group_of
from canshaper.can.layout import Layout, is_j1939
from canshaper.can.signals import find_signal, special_codes
from canshaper.config.source import DeploymentError, Problem
from canshaper.service.controller import Controller
from canshaper.service.lever import LeverInput
from canshaper.shaping.axis import Axis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.registry import Off
from canshaper.shaping.states import MOVING, Reason, State, StickInput

# A command below this is neutral: the ramp begins there.
NEUTRAL_BAND = 1e-4
# Fall of the command when the measurement ends early, full commands per second.
FALL_PER_S = 5.0
# Feedback older than that says nothing of the axis, which must not go on unseen.
SILENT_NS = 500_000_000


class _RampLever:
    """A lever that is held in neutral with its enable on; the ramp stands for its stick."""

    def __init__(self, lever: LeverInput) -> None:
        self._lever = lever
        self.command = 0.0

    def stick(
        self, signal: str, now_ns: int, since_ns: int, trip: Reason | None, neutral_band: float
    ) -> StickInput:
        """What the axis may use now."""
        found = self._lever.stick(signal, now_ns, since_ns, trip, neutral_band)
        if found.fault is not None or not found.enabled:
            return found
        if abs(found.command) > neutral_band:
            return StickInput(fault=Reason.STICK_NOT_NEUTRAL, trip=found.trip)
        return found._replace(command=self.command, bypass=False)


class CalibrationDrive:
    """A measurement in progress: frames in, frames out.

    Args:
        deployment: the machine.
        axis: name of one of its axes.
        speed: (message, signal) of the feedback of its speed.
        ramp: the command.

    Attributes:
        ended: why it is over; empty while it goes on.
        progress: how much of the ramp is done, 0 to 1.

    Raises:
        DeploymentError: no such message or signal.
    """

    def __init__(
        self, deployment: Deployment, axis: str, speed: tuple[str, str], ramp: Ramp
    ) -> None:
        self._hear(deployment, *speed)
        self._controller = Controller(deployment)
        self._runner = runner = self._controller.axes[axis]
        period_s = deployment.config.tick_ms / 1000.0 * runner.bound.period_ticks
        runner.compensator = runner.chooser = None
        runner.axis = Axis(
            period_s,
            OutputLimits(maximum=1.0, rise_per_s=FALL_PER_S, fall_per_s=FALL_PER_S, tail_s=0.0),
            sway=None,
            shaper=Off(),
            neutral_band=NEUTRAL_BAND,
            stop_s=1.0,
            grid_steps=runner.bound.valve.steps,
        )
        self._lever = _RampLever(self._controller.levers[runner.bound.config.stick.lever])
        runner.replace_lever(self._lever)
        self._ramp = ramp
        self._begun_ns: int | None = None
        self._latest: float | None = None
        self._heard_ns = 0
        self._samples: dict[str, list[Sample]] = {}
        self.ended = ""
        self.progress = 0.0

    def _hear(self, deployment: Deployment, message: str, signal: str) -> None:
        found = deployment.messages.find(message)
        if isinstance(found, str):
            raise DeploymentError([Problem("command line", None, "--speed", found)])
        definition = find_signal(found[1], signal)
        if definition is None:
            names = [s.name for s in found[1].signals]
            raise _problem(deployment, "--speed", signal, f"signals of {message}", names)
        self._message = found[1]
        self._any = is_j1939(self._message)
        self._signal = definition
        self._layout = Layout(self._message)
        self._special = special_codes(definition)

    @property
    def waiting_for(self) -> str:
        """What the axis still waits for, before the ramp begins."""
        if self._begun_ns is not None:
            return ""
        axis = self._runner.axis
        return "feedback" if axis.state is State.READY else axis.reason.name

    def receive(self, frame: Frame, now_ns: int) -> Frame | None:
        """Take a frame from a bus; what it leaves as on the other bus of a gateway, or None."""
        passed = self._controller.receive(frame, now_ns)
        known = self._message.frame_id
        mine = group_of(frame.can_id) == group_of(known) if self._any else frame.can_id == known
        if (
            mine
            and frame.extended == self._message.is_extended_frame
            and len(frame.data) == self._message.length
        ):
            raw: Any = self._layout.decode(frame.data)[self._signal.name]
            if raw not in self._special:
                self._latest = raw * self._signal.scale + self._signal.offset
                self._heard_ns = now_ns
        return passed

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """One tick: the frames to send."""
        axis = self._runner.axis
        state = axis.state
        heard = self._latest is not None and now_ns - self._heard_ns <= SILENT_NS
        if self._begun_ns is None and state is State.READY and heard:
            self._begun_ns = now_ns
        if self._begun_ns is not None and not self.ended:
            time_s = (now_ns - self._begun_ns) / 1e9
            self.progress = min(1.0, time_s / self._ramp.duration_s)
            self._lever.command = self._ramp.command(time_s)
            self._sample(time_s)
            if time_s >= self._ramp.duration_s:
                self.ended = "done"
            elif state not in MOVING and state is not State.READY:
                self.ended = f"stopped: {axis.reason.name}"
            elif not heard:
                self.ended = "stopped: the feedback fell silent, or tells an error"
            if self.ended:
                self._lever.command = 0.0
        yield from self._controller.tick(now_ns, missed)
        self._controller.events.clear()

    def send_failed(self, frame: Frame) -> None:
        """A frame did not reach its bus; the axes of a valve frame trip."""
        self._controller.send_failed(frame)

    def stalled(self) -> None:
        """The loop stood still: what moves goes to neutral."""
        self._controller.stalled()

    def _sample(self, time_s: float) -> None:
        if self._latest is None:
            return
        sent = self._runner.axis.raw / self._runner.bound.valve.steps
        part = self._ramp.part(time_s)
        self._samples.setdefault(part, []).append(Sample(sent, self._latest))

    def neutral_frames(self) -> list[Frame]:
        """A neutral frame for every valve."""
        return self._controller.neutral_frames()

    def result(self) -> Calibration:
        """What was measured.

        Raises:
            CalibrationError: it did not go to its end, or makes no curve.
        """
        if self.ended != "done":
            raise CalibrationError(f"the measurement was not taken to its end: {self.ended}")
        rest = [s.speed for s in self._samples.get("rest", [])]
        if len(rest) < 2:
            raise CalibrationError("no feedback came while the axis was at rest")
        noise, zero = statistics.pstdev(rest), statistics.fmean(rest)
        found = []
        for sign, mark in ((1.0, "+"), (-1.0, "-")):
            # The feedback may count the other way round than the command.
            parts = [self._samples.get(f"{way}{mark}", []) for way in ("up", "held", "down")]
            way = 1.0 if sum(s.speed - zero for s in parts[0]) >= 0.0 else -1.0
            up, held, down = (
                [Sample(abs(s.command), way * (s.speed - zero)) for s in part] for part in parts
            )
            try:
                found.append((sign * way, fit(up, held, down, noise)))
            except CalibrationError as error:
                direction = "positive" if sign > 0 else "negative"
                raise CalibrationError(f"{direction} commands: {error}") from None
        if found[0][0] != found[1][0]:
            raise CalibrationError("both directions moved the same way; is the feedback signed?")
        return Calibration(found[0][1], found[1][1])


def _problem(
    deployment: Deployment, option: str, found: str, what: str, names: Any
) -> DeploymentError:
    text = f"found {found!r}, {what} are {', '.join(names)}"
    return DeploymentError([Problem(str(deployment.path), None, option, text)])
