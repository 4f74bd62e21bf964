"""State of each axis, rate of each source, and swing, from the frames on the buses. No clock."""

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from canshaper.config.adjust import AxisKey, adjusted
from canshaper.config.limits import Sway
from canshaper.design.tuning.evaluate import Machine, evaluate, shaper_of
from canshaper.machine.deployment import Deployment
from canshaper.machine.valves import BoundAxis
from canshaper.studio.words import reason_words, state_level, state_words
from canshaper_sim.axes import BRIDGE, EXTENSION, KNUCKLE, LIFT_CYLINDER, NEAR_FAR, SLEW, TROLLEY

WINDOW_S = 1.0
"""Frames are counted over the last second."""
MOST_FRAMES = 2000
"""Frames of a source that are counted in it."""


@dataclass
class AxisView:
    """State of an axis on the page: fractions of full, -1 to 1; degrees; None if unknown.

    ``opening`` is the value of the valve frame, ``valve`` the speed it stands for.
    """

    joystick: float | None = None
    opening: float = 0.0
    valve: float | None = None
    state: int | None = None
    reason: int | None = None
    predicted_deg: float | None = None
    profile: str | None = None

    def values(self) -> dict[str, Any]:
        """Return what the page shows of the axis: rounded, with words for state and reason."""
        return {
            "joystick": rounded(self.joystick),
            "valve": rounded(self.valve),
            "predicted": rounded(self.predicted_deg, 2),
            "state": None if self.state is None else state_words(self.state),
            "level": state_level(self.state),
            "reason": None if self.reason is None else reason_words(self.reason),
            "profile": self.profile,
        }


def rounded(value: float | None, digits: int = 4) -> float | None:
    """Return a number rounded for the page; None stays None."""
    return None if value is None else round(value, digits)


class Sources:
    """Times of the frames of each source; ``names`` are the sources in the order of the page."""

    def __init__(self, names: Iterable[str]) -> None:
        self._times_s = {name: deque[float](maxlen=MOST_FRAMES) for name in names}

    def on_frame(self, name: str, now_s: float) -> None:
        """Count a frame of a source."""
        self._times_s[name].append(now_s)

    def age_s(self, name: str, now_s: float) -> float | None:
        """Return the age of a source's last frame, s; None before the first."""
        times_s = self._times_s[name]
        return now_s - times_s[-1] if times_s else None

    def values(self, now_s: float) -> dict[str, Any]:
        """Return by source ``per_s``, frames in the last second, and ``age_s`` of the last one."""
        values = {}
        for name, times_s in self._times_s.items():
            age_s = self.age_s(name, now_s)
            while len(times_s) > 1 and times_s[0] <= now_s - WINDOW_S:
                times_s.popleft()
            fresh = age_s is not None and age_s < WINDOW_S
            values[name] = {
                "per_s": len(times_s) if fresh else 0,
                "age_s": None if age_s is None else round(age_s, 2),
            }
        return values


ACROSS, ALONG = "across", "along"
_SWAY_OF = {
    SLEW: ACROSS,
    NEAR_FAR: ALONG,
    LIFT_CYLINDER: ALONG,
    KNUCKLE: ALONG,
    EXTENSION: ALONG,
    BRIDGE: ACROSS,
    TROLLEY: ALONG,
}
LEAST_SWING_S = 1.0
"""Shortest time over which the largest sway counts as the swing."""


def sway_of(coordinates: Mapping[str, str]) -> dict[str, str]:
    """Return by axis the swing that it excites, across boom or bridge or along it, if any."""
    return {axis: _SWAY_OF[moved] for axis, moved in coordinates.items() if moved in _SWAY_OF}


class Swing:
    """Largest sway in any direction over one full swing, and how long it lasts after a release.

    Args:
        models: sway models; a full swing is the longest of their periods and ``LEAST_SWING_S``.
        still_deg: swing below which the grapple counts as still.
    """

    def __init__(self, models: Iterable[Sway], still_deg: float) -> None:
        periods = [2.0 * math.pi / model.mode().omega_rad_s for model in models]
        self._lasts_s = max([LEAST_SWING_S, *periods])
        self._still_deg = still_deg
        self._sways: deque[tuple[float, float]] = deque()
        self._over_s = -math.inf
        self._moved = self._drove = False
        self._released_s: float | None = None

    def add(self, sway_deg: tuple[float, float], now_s: float) -> None:
        """Take a sway (across, along the boom), degrees."""
        sway = math.hypot(*sway_deg)
        self._sways.append((now_s, sway))
        if sway >= self._still_deg:
            self._over_s = now_s

    def move(self, now_s: float, *, moved: bool, drives: bool) -> None:
        """Note press or release; ``moved``: a joystick is deflected, ``drives``: a valve open."""
        if moved:
            self._released_s = None
            self._drove = drives or (self._moved and self._drove)
        elif self._moved and self._drove:
            self._released_s = now_s
        self._moved = moved

    def still_s(self, now_s: float) -> tuple[float | None, bool]:
        """Return the time in s from release to the last sway of ``still_deg``, and if it goes on.

        The time is None before a release, while a joystick is deflected, and after a press that
        opened no valve. The swing is over when no such sway has come for one full swing.
        """
        if self._released_s is None:
            return None, False
        return max(self._over_s - self._released_s, 0.0), now_s - self._over_s < self._lasts_s

    def invalidate(self) -> None:
        """Forget all sway and releases."""
        self._sways.clear()
        self._over_s, self._released_s, self._moved = -math.inf, None, False

    def largest_deg(self, now_s: float) -> float | None:
        """Return the largest sway within the last full swing, degrees; None if none came in it."""
        while self._sways and self._sways[0][0] < now_s - self._lasts_s:
            self._sways.popleft()
        return max((sway for _, sway in self._sways), default=None)


STANDARD_GRAVITY_M_S2 = 9.80665
LENGTHS_PCT = tuple(range(-50, 101, 5))
"""Deviations of the pendulum length from the file, percent."""


def residuals(deployment: Deployment, values: Mapping[str, float]) -> dict[str, dict[str, Any]]:
    """Return the swing that each filter leaves at other pendulum lengths.

    Args:
        deployment: the machine.
        values: numbers in force, by key as in the file; those of no axis are ignored.

    Returns:
        By axis with sway data and a single filter: ``lengths_m`` of simple pendulums; ``left``, a
        fraction of the swing without filter for each length; the length, m, that the filter
        ``believes``; that of the ``file``.
    """
    by_axis: dict[str, dict[AxisKey, float]] = {}
    for text, number in values.items():
        key = AxisKey.parsed(text)
        if key is not None:
            by_axis.setdefault(key.axis, {})[key] = number
    tick_s = deployment.config.tick_ms / 1000.0
    curves = {}
    for name, bound in deployment.axes.items():
        config = bound.config
        if config.sway and not config.gain_schedule and not config.profiles:
            curves[name] = _curve(bound, by_axis.get(name, {}), tick_s * bound.period_ticks)
    return curves


def _curve(bound: BoundAxis, values: Mapping[AxisKey, float], period_s: float) -> dict[str, Any]:
    config = adjusted(bound.config, values, bound.config) if values else bound.config
    assert config.sway is not None and bound.config.sway is not None
    mode = config.sway.mode()
    shaper_for = shaper_of(config.filter, period_s, config.limits.slowest_per_s)
    believes_m = STANDARD_GRAVITY_M_S2 / mode.omega_rad_s**2
    file_m = STANDARD_GRAVITY_M_S2 / bound.config.sway.mode().omega_rad_s ** 2
    lengths_m = [file_m * (1.0 + percent / 100.0) for percent in LENGTHS_PCT]
    errors_pct = [100.0 * (length / believes_m - 1.0) for length in lengths_m]
    residuals = evaluate(mode, period_s, shaper_for, Machine.of(bound), errors_pct).residuals
    return {
        "lengths_m": [round(length, 4) for length in lengths_m],
        "left": [round(one.machine, 4) for one in residuals],
        "believes": round(believes_m, 4),
        "file": round(file_m, 4),
    }
