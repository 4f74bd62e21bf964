"""Effects that a fault of the sway sensor may have on slew: none beyond the limits of the file.

Shares no code with canshaper: joystick, valve and status frames of the log, byte by byte.
"""

from collections import Counter
from typing import NamedTuple

JOYSTICK, STOP, VALVE, STATUS = 0x110, 0x112, 0x200, 0x308
STATES = ("NEUTRAL_WAIT", "READY", "ACTIVE", "BYPASS_ON", "STOPPING", "TRIPPED")
SENSOR = (
    *("NO_DATA", "UNPROVED", "TRUSTED", "LOST", "STUCK", "JUMP", "WRONG_SIGN", "OFFSET"),
    *("CONTACT", "RESTLESS"),
)
# Of the file, per frame of the valve: rise_per_s and fall_per_s of 5, tail_s of 2.
RATE, TAIL = 0.1, 100
NEUTRAL, DEADBAND, STEPS = 0.02, 0.05, 125
STEP = 1.0 / STEPS / (1.0 - DEADBAND)
# Frames that come so late stop an axis, whatever the sensor does: timeouts of the file less a tick.
LATE_S = 0.08
# Until what a sensor added has faded, in 30, and G_FF has answered a reversal out of full swing.
FADED = 150
# Frames from the joystick's to the valve's that heeds it.
SLACK = 5


class Logged(NamedTuple):
    """A frame of the log: identifier, bytes, time in seconds."""

    key: int
    data: bytes
    time_s: float


class SlewJudge:
    """Reads the log of a drive, frame by frame; what is wrong is collected in ``wrong``.

    Attributes:
        wrong: what must not be.
        velocity, command: last ones of valve and joystick, parts of full.
        sensor: last of what the status said of the sensor.
        said: how often each was said.
        valves: frames of the valve.
        stood_still: frames of joystick, emergency stop or valve came late: the drive shows nothing.
    """

    def __init__(self) -> None:
        self.wrong: list[str] = []
        self.sensor = SENSOR[0]
        self.said: Counter[str] = Counter()
        self.valves = 0
        self.stood_still = False
        self._came_s: dict[int, float] = {}
        self.velocity = 0.0
        self._commands: list[float] = []  # at each frame of the valve
        self.command = 0.0
        self._trusted = 0  # the valve's frame at which it was so last

    def begin_fault(self) -> None:
        """Forget the reports on the sensor: they were before its fault."""
        self.said.clear()

    def read_all(self, frames: list[Logged]) -> None:
        """Take these frames."""
        for key, data, time_s in frames:
            if key in (JOYSTICK, STOP, VALVE):
                self.stood_still |= time_s - self._came_s.get(key, time_s) > LATE_S
                self._came_s[key] = time_s
            self._read(key, data)

    def _read(self, key: int, data: bytes) -> None:
        if key == JOYSTICK:
            command = int.from_bytes(data[:2], "little", signed=True) / 1000.0
            self.command = command if abs(command) > NEUTRAL else 0.0
        elif key == STATUS:
            state, self.sensor = STATES[data[0] & 15], SENSOR[data[0] >> 4]
            self.said[self.sensor] += 1
            if self.sensor == "TRUSTED":
                self._trusted = self.valves
            if state not in ("READY", "ACTIVE"):
                self.wrong.append(f"{state} for reason {data[1]} after {self.valves} frames")
        elif key == VALVE:
            self._valve(int.from_bytes(data[:1], "little", signed=True))

    def _valve(self, raw: int) -> None:
        self.valves += 1
        self._commands.append(self.command)
        recent = self._commands[-TAIL - SLACK :]
        low, high = min(0.0, *recent), max(0.0, *recent)
        if min(recent[-SLACK:]) > 0.0:  # not against the joystick
            low = 0.0
        if max(recent[-SLACK:]) < 0.0:
            high = 0.0
        opening = max(0.0, abs(raw) / STEPS - DEADBAND) / (1.0 - DEADBAND)
        before, now = self.velocity, opening if raw > 0 else -opening
        self.velocity = now
        # Beyond them only on the way back.
        low, high = min(low, before + RATE), max(high, before - RATE)
        if not low - 1.5 * STEP <= now <= high + 1.5 * STEP:
            self.wrong.append(f"{now:.3f} after {before:.3f}, allowed {low:.3f} to {high:.3f}")
        if abs(now - before) > RATE + 1.5 * STEP:
            self.wrong.append(f"{now:.3f} after {before:.3f}: quicker than the rates")
        if raw and not any(recent):
            self.wrong.append(f"moves by {raw} with nothing commanded within the tail")

    def follows(self) -> bool:
        """Whether the valve gets the joystick command where no sensor moves it any more."""
        if self.valves - self._trusted < FADED or len({*self._commands[-FADED:]}) > 2:
            return True
        return abs(self.velocity - self.command) <= 3.0 * STEP
