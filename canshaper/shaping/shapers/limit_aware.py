"""A linear shaper made aware of the limits that cut its output.

    v* = y - K1 (angle - angle_twin) - K2 (rate - rate_twin)

The axis' sway model is driven by what was sent, its twin by what the shaper asked for. Why:
docs/decisions.md#limits-by-a-twin.
"""

import math
from collections.abc import Sequence

from canshaper.shaping.shapers.fir import Fir, stretched, zv_taps
from canshaper.shaping.shapers.gff import Gff
from canshaper.shaping.shapers.kind import Parameter, Parameters, Shaper, ShaperKind
from canshaper.shaping.sway import SwayMode, SwayModel

# Both poles of the feedback, in natural frequencies: faster than the swing, and slow enough for a
# valve that takes a fifth of a second to full speed.
POLE_PER_OMEGA = -1.4


# A slow valve cannot follow quick poles, and feedback it cannot follow adds swing. What it can
# follow grows with the root of its rate, as for the poles of G_FF; 1.3 left least swing of 0.4 to
# 1.6 over valves of 0.7 to 5 full speeds per second.
POLE_PER_ROOT = -1.3


# Taps for a rope: positions between the shortest and the longest, between two of them interpolated.
TABLE_STEPS = 64


class LimitAware:
    """A shaper with feedback of the swing that limits have caused.

    Args:
        sway: sway model of the axis; its owner steps it with what was sent.
        shaper: the shaper.
        rate_per_s: rate of the valve, full speeds per second.

    Raises:
        ValueError: the tick is too long for the feedback.
    """

    spreads = True
    __slots__ = ("_pole", "_rate", "_sway", "_table", "_twin", "_unlimited", "gff", "shaper")

    def __init__(self, sway: SwayModel, shaper: Fir, rate_per_s: float = math.inf) -> None:
        omega, fastest = sway.mode.omega_rad_s, -1.0 / (POLE_PER_OMEGA * sway.tick_s)
        if omega > fastest:
            raise ValueError(
                f"natural frequency: expected up to {fastest:g} rad/s for this filter"
                f" at a tick of {sway.tick_s:g} s, got {omega:g} rad/s"
            )
        self._rate = rate_per_s
        self._pole = pole = self._pole_rad_s(omega)
        self.gff = Gff(sway, (pole, pole))
        self._table: (
            tuple[float, float, list[tuple[list[float], list[float], list[float]]]] | None
        ) = None
        self._sway = sway
        self._twin = SwayModel(sway.mode, sway.tick_s)
        self.shaper = shaper
        self._unlimited = 0.0

    def _pole_rad_s(self, omega: float) -> float:
        return max(POLE_PER_OMEGA * omega, POLE_PER_ROOT * math.sqrt(self._rate * omega))

    def prepare(self, least: float, most: float) -> None:
        """Compute the taps for the factors of ``follow``, from least to most.

        For each of them compute also the twin's response to a command of one tick.
        """
        taps, period_s = self.shaper.taps, self._sway.mode.period_s
        longest = len(stretched(taps, most))
        rows = []
        for i in range(TABLE_STEPS + 1):
            factor = least + (most - least) * i / TABLE_STEPS
            row = stretched(taps, factor)
            row += [0.0] * (longest - len(row))
            ratio = self._sway.mode.damping_ratio
            twin = SwayModel(SwayMode.from_period(factor * period_s, ratio), self._sway.tick_s)
            angles, rates = [], []
            for tap in row:
                angles.append(twin.angle)
                rates.append(twin.rate)
                twin.step(tap)
            rows.append((row, angles, rates))
        self._table = least, (most - least) / TABLE_STEPS, rows
        self.shaper.lengthen(longest)

    def follow(self, factor: float) -> None:
        """Adapt to the present sway model: stretch the taps by the factor, clamped as prepared.

        The twin gets the swing that it would have had with this rope from the start. So its swing
        ends with the taps, and the feedback damps what the change of length did to the real swing.
        """
        assert self._table is not None  # it was prepared
        least, step, rows = self._table
        at = min(max((factor - least) / step, 0.0), TABLE_STEPS - 1e-9)
        low, high, share = rows[int(at)], rows[int(at) + 1], at % 1.0
        shaper, twin, mode = self.shaper, self._twin, self._sway.mode
        shaper.taps = [a + share * (b - a) for a, b in zip(low[0], high[0], strict=True)]
        twin.follow(mode)
        if self._sway.angle != 0.0 or self._sway.rate != 0.0:
            now, then = (map(shaper.response, one) for one in (low, high))
            self._unlimited, twin.angle, twin.rate = (
                a + share * (b - a) for a, b in zip(now, then, strict=True)
            )
        self.gff.follow(self._pole / self._pole_rad_s(mode.omega_rad_s))

    def copy_state(self, old: "LimitAware") -> None:
        """Copy the state of another filter of this class."""
        self._twin = old._twin.retuned(self._sway.mode, old._unlimited)
        self._unlimited = old._unlimited
        self.shaper.copy_state(old.shaper)

    def swing_again(self) -> None:
        """Give the twin the swing that it would have had with these taps from the start."""
        shaper, twin = self.shaper, SwayModel(self._sway.mode, self._sway.tick_s)
        angles, rates = [], []
        for tap in shaper.taps:
            angles.append(twin.angle)
            rates.append(twin.rate)
            twin.step(tap)
        self._twin.angle, self._twin.rate = shaper.response(angles), shaper.response(rates)
        self._unlimited = shaper.response(shaper.taps)

    def reset_to_steady_state(self, command: float) -> None:
        """Set the memory as if the command had been constant for long, without swing by limits."""
        self._twin.angle, self._twin.rate = self._sway.angle, self._sway.rate
        self._unlimited = command
        self.shaper.reset_to_steady_state(command)

    def step(self, command: float) -> float:
        """Return the output for this tick's command, before limits."""
        sway, twin = self._sway, self._twin
        twin.step(self._unlimited)
        if sway.angle == 0.0 == sway.rate:  # never moved, or started again after a fault
            twin.angle = twin.rate = 0.0
        self._unlimited = unlimited = self.shaper.step(command)
        return (
            unlimited
            - self.gff.k1 * (sway.angle + sway.free_angle - twin.angle)
            - self.gff.k2 * (sway.rate + sway.free_rate - twin.rate)
        )


def _robust(
    sway: SwayModel, *, taps: Sequence[float], valve_rate_per_s: float, tick_ms: float | None = None
) -> Shaper:
    if tick_ms is not None and tick_ms != round(1000.0 * sway.tick_s):
        raise ValueError(
            f"tick_ms of the taps: expected the period of the valve, {1000.0 * sway.tick_s:g} ms,"
            f" got {tick_ms:g} ms"
        )
    return LimitAware(sway, Fir(taps), valve_rate_per_s)


def _check(*, taps: Sequence[float], tick_ms: int) -> None:
    Fir(taps)


def _settings(mode: SwayMode, tick_s: float) -> dict[str, Parameters]:
    taps = zv_taps(mode, tick_s)
    return {"limit-aware ZV": {"tick_ms": round(1000.0 * tick_s), "taps": taps}}


def _stretched(parameters: Parameters, factor: float) -> Parameters:
    return parameters | {"taps": stretched(parameters["taps"], factor)}


KINDS = (
    ShaperKind(
        "robust",
        "A non-negative impulse response, for a range of pendulum lengths, made limit-aware.",
        _robust,
        _settings,
        (
            Parameter("tick_ms", 1, 200, "ms", "period of the taps: that of the valve", whole=True),
            Parameter("taps", 0, 1, "", "tap of the impulse response", entries=(1, 1000)),
        ),
        needs_sway=True,
        needs_valve_rate=True,
        limit_aware=True,
        check=_check,
        designed_by="robust",
        stretched=_stretched,
        follows=_stretched,
        runs_ahead=True,
    ),
)
