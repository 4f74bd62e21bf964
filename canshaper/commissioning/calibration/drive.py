"""Drives axes through a ramp with the daemon's own controller, and listens to their speeds.

Everything that may stop the daemon stops this too: enable, timeouts, emergency stop, a second
sender, the gate, for which the ramp is the demand. The joystick has to stay in neutral; moving it
ends the measurement.
"""

import statistics
from collections.abc import Iterator, Mapping
from dataclasses import replace

from canshaper.codec.frame import Frame
from canshaper.commissioning.calibration.fit import Calibration, Sample, fit
from canshaper.commissioning.calibration.pump import Moment
from canshaper.commissioning.calibration.ramp import EndStopDetector, Ramp, SpeedFeedback
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.errors import CalibrationError, ConfigError
from canshaper.inputs.joystick import JoystickInput
from canshaper.machine.deployment import Deployment
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import MOVING, CommandInput, Reason, State
from canshaper.shaping.transfer import Off

# A command below this is neutral: the ramp begins there.
NEUTRAL_BAND = 1e-4
Name = tuple[str, str]
Names = Mapping[str, Name]


class _RampJoystick:
    """A joystick that is held in neutral with its enable on; the ramp replaces its deflection.

    Attributes:
        deflection: command of the ramp, part of full; 0 for an axis that is not measured.
        moved: whether the joystick itself, valid and enabled, is not in neutral.
    """

    def __init__(self, joystick: JoystickInput) -> None:
        self._joystick = joystick
        self.deflection = 0.0
        self.moved = False

    def command(
        self, signal: str, now_ns: int, releases: int, trip: Reason | None, neutral_band: float
    ) -> tuple[CommandInput, int]:
        """Return the ramp, or why the joystick forbids it; and the releases of enable so far."""
        given, releases = self._joystick.command(signal, now_ns, releases, trip, neutral_band)
        usable = given.fault is None and given.enabled
        self.moved = usable and abs(given.command) > neutral_band
        if not usable:
            return given, releases
        if self.moved:  # contradicts the ramp: a fault that stops the axis through its filter
            contradicts = Reason.JOYSTICK_CONTRADICTORY
            return CommandInput(fault=contradicts, trip=given.trip), releases
        return given._replace(command=self.deflection, bypass=False), releases


class CalibrationDrive:
    """A measurement in progress: frames in, frames out.

    Args:
        deployment, axis: the machine, and the name of one of its axes.
        speed: (message, signal) of the feedback of its speed.
        ramp: the command to follow.
        also: (message, signal) of a second axis, by its name; it is driven alone after the first,
            then both at once.

    Attributes:
        turns, duration_s: axes that each run of the ramp drives, and the time of all runs.
        moments: demands and speeds of the axes, tick by tick, from the begin of the ramp on.
        ended: why it is over, "done" where all runs are; empty while it goes on.
        progress: how much of all runs is done, 0 to 1.

    Raises:
        ConfigError: no such message or signal; the ramp is faster than the file's ``max_pct``.
    """

    def __init__(
        self, deployment: Deployment, axis: str, speed: Name, ramp: Ramp, also: Names | None = None
    ) -> None:
        speeds = {axis: speed, **(also or {})}
        for name in speeds:
            _check_top(deployment, name, ramp)
        # Numbers that may be adjusted while the daemon runs do not bound a measurement.
        config = deployment.config.model_copy(update={"control": None})
        deployment = replace(deployment, config=config)
        feedback = {name: SpeedFeedback(deployment, name, *one) for name, one in speeds.items()}
        self._controller = Controller(deployment)
        self._gated = GatedController(self._controller)
        # Only these axes move: the others get a neutral joystick and take no part in a motion.
        self._joysticks: dict[str, _RampJoystick] = {}
        for name, one in self._controller.axes.items():
            joystick = _RampJoystick(self._controller.joysticks[one.bound.config.command.joystick])
            limits = one.bound.config.limits
            measured = ShapedAxis(
                deployment.config.tick_ms / 1000.0 * one.bound.period_ticks,
                OutputLimits(
                    limits.max_pct / 100.0, 0.0, limits.rise_per_s, limits.fall_per_s, tail_s=0.0
                ),
                sway=None,
                shaper=Off(),
                neutral_band=NEUTRAL_BAND,
                stop_s=1.0,
                grid_steps=one.bound.valve.steps,
            )
            one.isolate(joystick, measured if name in speeds else None)
            self._joysticks[name] = joystick
        of, ramped = self._controller.axes, self._joysticks
        self._driven = {name: (of[name], ramped.pop(name), feedback[name]) for name in speeds}
        self.axis, self.ramp = axis, ramp
        self.turns = [(name,) for name in speeds] + [tuple(speeds)] * (len(speeds) > 1)
        self.duration_s = len(self.turns) * ramp.duration_s
        self.moments: list[Moment] = []
        self._begun_ns: int | None = None
        self._samples: dict[str, list[Sample]] = {}
        self.ended = ""
        self.progress = 0.0
        self._ends = {name: EndStopDetector() for name in speeds}

    @property
    def waiting_for(self) -> str:
        """Reason for which the ramp has not begun, or words; empty once it has."""
        if self._begun_ns is not None:
            return ""
        for control, joystick, _ in self._driven.values():
            if joystick.moved:
                return Reason.JOYSTICK_NOT_NEUTRAL.name
            if control.axis.state is not State.READY:
                return control.axis.reason.name
        return f"the joystick of {moved}" if (moved := self._moved) else "feedback"

    @property
    def _moved(self) -> str:
        """Names of axes that are not measured and whose joystick is not in neutral, for people."""
        return " and ".join(name for name, joystick in self._joysticks.items() if joystick.moved)

    @property
    def moves(self) -> bool:
        """Whether the frame that was handed out last may move a valve."""
        return self._gated.moves

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        """Take a frame from a bus; return the frame for the other bus of a gateway, or None."""
        for *_, speed in self._driven.values():
            speed.receive(frame, arrived_ns)
        return self._gated.receive(frame, arrived_ns)

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        """Begin, follow or end the ramp (see ``ended``); yield the frames to send in this tick."""
        driven = self._driven.values()
        valid = all(speed.valid(now_ns) for *_, speed in driven)
        waits = [one.axis for one, *_ in driven if one.axis.state is not State.READY]
        if self._begun_ns is None and not waits and valid and not self._moved:
            self._begun_ns = now_ns
        command, turn = 0.0, self.turns[-1]
        if self._begun_ns is not None and not self.ended:
            time_s = (now_ns - self._begun_ns) / 1e9
            self.progress = min(1.0, time_s / self.duration_s)
            done, into_s = divmod(time_s, self.ramp.duration_s)
            turn = self.turns[min(int(done), len(self.turns) - 1)]
            self._sample(time_s)
            # An axis also stands where the other one takes its oil, so only one that is driven
            # alone is watched; both have the same room when they are driven at once.
            ramp, part = self.ramp.command(into_s), self.ramp.part(into_s)
            speed = self._driven[turn[0]][2].value
            if time_s >= self.duration_s:
                self.ended = "done"
            elif stopped := [one.reason.name for one in waits if one.state not in MOVING]:
                self.ended = f"stopped: {stopped[0]}"
            elif self._moved:
                self.ended = f"stopped: the joystick of {self._moved} was moved"
            elif not valid:
                self.ended = "stopped: the feedback fell silent, or reports an error"
            elif len(turn) == 1 and self._ends[turn[0]].reached(part, into_s, ramp, speed):
                text = f"at {abs(ramp):.0%} of the command it moves no more"
                room = f"give it room for {self.ramp.travel_s:.1f} s at full deflection"
                self.ended = f"stopped: {text}: its end? {room}"
            if not self.ended and State.STOPPING not in [one.state for one in waits]:
                command = ramp  # while one axis stops, the other does not move on
        for name, (_, joystick, _) in self._driven.items():
            joystick.deflection = command if name in turn else 0.0
            self._gated.demand(name, joystick.deflection)
        yield from self._gated.tick(now_ns, missed)
        self._controller.events.clear()

    def send_failed(self, frame: Frame) -> None:
        """Take note that a frame did not reach its bus; the axes of a valve frame trip."""
        self._gated.send_failed(frame)

    def withhold(self, frame: Frame) -> bool:
        """Return whether a late valve frame moves a valve, and so must not leave."""
        return self._gated.withhold(frame)

    def stalled(self) -> None:
        """Take note that the loop stood still: moving axes trip, waiting frames do not count."""
        self._gated.stalled()

    def _sample(self, time_s: float) -> None:
        moment = [time_s]
        for name, (one, _, speed) in self._driven.items():
            sample = Sample(one.axis.output.steps / one.bound.valve.steps, speed.value)
            if name == self.axis:
                self._samples.setdefault(self.ramp.part(time_s), []).append(sample)
            limits = one.bound.config.limits.output_limits()
            moment += (limits.velocity(sample.command), sample.speed)
        self.moments.append(moment)

    def neutral_frames(self) -> list[Frame]:
        """Return the neutral frames to send last, without those that the gate refuses."""
        return self._gated.neutral_frames()

    def check_ended(self) -> None:
        """Raise CalibrationError where the ramp was not driven to its end."""
        if self.ended != "done":
            raise CalibrationError(f"the measurement was not taken to its end: {self.ended}")

    def result(self) -> Calibration:
        """Return the measured valve of ``axis``.

        Raises:
            CalibrationError: it did not go to its end, or makes no curve.
        """
        self.check_ended()
        rest = [s.speed for s in self._samples.get("rest", [])]
        if len(rest) < 2:
            raise CalibrationError("no feedback came while the axis was at rest")
        noise, zero = statistics.pstdev(rest), statistics.fmean(rest)
        ways = []
        for sign, mark in ((1.0, "+"), (-1.0, "-")):
            # The feedback may have the opposite sign of the command.
            parts = [self._samples.get(f"{way}{mark}", []) for way in ("up", "held", "down")]
            way = 1.0 if sum(s.speed - zero for s in parts[0]) >= 0.0 else -1.0
            up, held, down = (
                [Sample(abs(s.command), way * (s.speed - zero)) for s in part] for part in parts
            )
            try:
                ways.append((sign * way, fit(up, held, down, noise)))
            except CalibrationError as error:
                direction = "positive" if sign > 0 else "negative"
                raise CalibrationError(f"{direction} commands: {error}") from None
        if ways[0][0] != ways[1][0]:
            raise CalibrationError("both directions moved the same way; is the feedback signed?")
        return Calibration(ways[0][1], ways[1][1])


def _check_top(deployment: Deployment, axis: str, ramp: Ramp) -> None:
    """Check that the ramp is no faster than the file allows.

    Raises:
        ConfigError: it is faster.
    """
    limits = deployment.config.axes[axis].limits
    curve = limits.curve()
    speeds = [abs(curve.velocity(way * ramp.top)) for way in (1.0, -1.0)] if curve else []
    fastest_pct = 100.0 * max([ramp.top, *speeds])
    if fastest_pct > limits.max_pct + 1e-6:
        text = f"expected a ramp (--top) up to {limits.max_pct:g} % of full speed"
        place = ("axes", axis, "limits", "max_pct")
        raise ConfigError([deployment.source.problem(place, f"{text}, got {fastest_pct:.4g} %")])
