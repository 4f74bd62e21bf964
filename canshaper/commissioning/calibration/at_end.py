"""An axis that has reached its end: it has moved, and stands though its valve is open."""

import math
from bisect import bisect_left

# So much farther from the middle of its tremble than that goes is motion.
LEAST = 5.0
# At its end the speed is below this part of what it was, for so long.
PART, LASTING_S = 0.5, 0.5


class EndWatch:
    """Watches the speed of an axis on its ramp."""

    def __init__(self) -> None:
        self._low, self._high = math.inf, -math.inf  # at rest
        # Commands of the way up and the largest speed until each, in order.
        self._commands: list[float] = []
        self._speeds: list[float] = []
        self._moved_s = 0.0

    def reached(self, part: str, time_s: float, command: float, speed: float) -> bool:
        """Take a speed; whether the axis is at its end.

        Args:
            part: of the ramp, as ``Ramp.part`` names it.
            time_s: of the measurement.
            command: of the ramp, part of full.
            speed: of the feedback, in its own unit.
        """
        if part in ("settling", "rest"):
            if part == "rest":
                self._low, self._high = min(self._low, speed), max(self._high, speed)
            self._commands, self._speeds = [], []
            return False
        away = abs(speed - 0.5 * (self._low + self._high))
        if not part.startswith("down"):
            self._commands.append(abs(command))
            self._speeds.append(max(away, self._speeds[-1] if self._speeds else 0.0))
        number = min(bisect_left(self._commands, abs(command)), len(self._speeds) - 1)
        before = self._speeds[number]
        if before <= LEAST * 0.5 * (self._high - self._low) or away >= PART * before:
            self._moved_s = time_s
        return time_s - self._moved_s >= LASTING_S
