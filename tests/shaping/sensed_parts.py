"""A sensed sway between parts that answer what a test sets, and note what they are asked."""

from types import SimpleNamespace
from typing import Any

import pytest

from canshaper.shaping import sensed
from canshaper.shaping.free_swing import FreeSwing, sensor_gains
from canshaper.shaping.observer import Errors
from canshaper.shaping.states import Trust
from canshaper.shaping.sway import Measured, SensorLimits, SensorTiming, SwayMode, SwayModel

# Times that are sums of these have no rounding error.
TICK_S, LOST_S = 1.0 / 64.0, 4.0 / 64.0
MODE = SwayMode(2.86, 0.05)
FULL_SPEED_M_S = 1.4
SCALE = MODE.angle_per_speed_rad * FULL_SPEED_M_S
NOISE, OFFSET = 0.002, 0.05

Call = tuple[Any, ...]
"""Name of a part's method, and what it was called with."""


class Observer:
    """Plays the observer: a measurement shows ``error``, and leaves ``left`` of it."""

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls
        self.free = FreeSwing(Measured.ANGLE, [(0.0, 0.0, 0.0)])
        self.late = SimpleNamespace(speed=0.0)
        self.error = self.left = 0.0
        self.bends = 0.0  # rad/s^2, by a lasting error

    def begin(self, value: float, scale: float) -> None:
        self._calls.append(("begin", value, scale))

    def errors(self, value: float, scale: float) -> Errors:
        self._calls.append(("errors", value, scale))
        return self.error, 0.0, 0.0, 0.0

    def correct(self, errors: Errors) -> float:
        self._calls.append(("correct", errors))
        return self.left

    def acceleration(self, _error: float) -> float:
        return self.bends

    def step(self, velocity: float, added: float) -> None:
        self._calls.append(("step", velocity, added))

    def swing(self, free: FreeSwing) -> None:
        self._calls.append(("swing", free.angle, free.rate))

    def ahead(self, free: FreeSwing) -> tuple[float, float]:
        return free.angle, free.rate

    def retune(self, sway: SwayModel) -> None:
        self._calls.append(("retune", sway))

    def restart(self) -> None:
        self._calls.append(("restart",))


class Evidence:
    """Plays the evidence: it has proved the sensor, or shows a fault."""

    surprise = 0.0

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls
        self.proves = False
        self.shows: Trust | None = None

    def add(self, errors: Errors) -> None:
        self._calls.append(("evidence.add", errors))

    def proved(self, least: float) -> bool:
        self._calls.append(("proved", least))
        return self.proves

    def fault(self, least: float) -> Trust | None:
        self._calls.append(("fault", least))
        return self.shows

    def clear(self) -> None:
        self._calls.append(("evidence.clear",))


class Standstill:
    """Plays what finds a standstill."""

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls
        self.shows: Trust | None = None

    def check(self, _value: float, _bent: float, *, command_active: bool) -> Trust | None:
        self._calls.append(("check", command_active))
        return self.shows

    def clear(self) -> None:
        self._calls.append(("standstill.clear",))


class Restlessness:
    """Plays what finds a command that goes to and fro."""

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls
        self.shows = False

    def add(self, velocity: float, command: float) -> bool:
        self._calls.append(("moved", velocity, command))
        return self.shows


class Length:
    """Plays the estimate of the length."""

    def __init__(self, calls: list[Call]) -> None:
        self._calls = calls

    def add(
        self, value: float, offset: float, speed_m_s: float, *, pressed: bool, free: bool
    ) -> None:
        self._calls.append(("length", value, offset, speed_m_s, pressed, free))


class Parts:
    """A sensed sway, ``sensed``, and the parts that play for it."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, second: SwayMode | None = None) -> None:
        self.calls: list[Call] = []
        self.observer, self.evidence = Observer(self.calls), Evidence(self.calls)
        self.standstill, self.restlessness = Standstill(self.calls), Restlessness(self.calls)
        for name, part in {
            "SwayObserver": self.observer,
            "Evidence": self.evidence,
            "Standstill": self.standstill,
            "Restlessness": self.restlessness,
            "SwingLengthEstimate": Length(self.calls),
        }.items():
            monkeypatch.setattr(sensed, name, lambda *_arguments, part=part: part)
        self.sway = SwayModel(MODE, TICK_S)
        timing = SensorTiming(Measured.ANGLE, TICK_S, 0.0, 0.0, lost_s=LOST_S)
        limits = SensorLimits(NOISE, OFFSET, second=second)
        gains = sensor_gains(MODE, TICK_S, timing, limits)
        self.sensed = sensed.SensedSway(self.sway, timing, limits, gains, damps=True)

    def begun(self) -> "Parts":
        """After the first measurement."""
        self.measure(commanded=False)
        assert self.sensed.state is Trust.UNPROVED
        return self

    def trusted(self) -> "Parts":
        """After a measurement that has proved the sensor, before the evidence says more."""
        self.begun()
        self.evidence.proves = True
        self.measure()
        assert self.sensed.state is Trust.TRUSTED
        self.evidence.proves = False
        return self

    def measure(
        self,
        value: float | None = 0.01,
        *,
        commanded: bool = True,
        damps: bool = False,
        other: float | None = None,
    ) -> list[Call]:
        """Measure once; what the parts were called with for it."""
        self.calls.clear()
        self.sensed.measure(value, SCALE, commanded=commanded, damps=damps, other=other)
        return list(self.calls)

    def step(self, velocity: float = 0.0, command: float = 0.0) -> list[Call]:
        """Advance a tick; what the parts were called with for it."""
        self.calls.clear()
        self.sensed.step(velocity, command)
        return list(self.calls)


def named(calls: list[Call], name: str) -> list[list[Any]]:
    """Arguments of the calls of a method of this name."""
    return [arguments for called, *arguments in calls if called == name]
