"""Shapers with a finite impulse response: ZV, ZVD, EI, two-mode, and any list of taps.

Non-negative taps that sum to one keep the output within the range of the last commands: limits of
magnitude never cut such a shaper. A bare shaper leaves |H(p)| = |sum h_k exp(-p k T)| of the swing
with sway pole p.
"""

import cmath
import math
from collections import deque
from collections.abc import Sequence
from itertools import accumulate, pairwise
from operator import mul

from canshaper.shaping.shapers.kind import Parameter, Shaper, ShaperKind
from canshaper.shaping.sway import SwayMode, SwayModel


class Fir:
    """Convolution of the command with taps, one a tick, the newest command first.

    Args:
        taps: impulse response, sum 1 within 0.1 %; it is scaled to 1.

    Raises:
        ValueError: no taps, a tap that is not a number, or a sum that is not 1.
    """

    __slots__ = ("_history", "taps")

    def __init__(self, taps: Sequence[float]) -> None:
        total = math.fsum(taps)
        # A tenth of a percent is rounding of taps written to a file, far below any valve's step.
        if not abs(total - 1.0) <= 1e-3:
            raise ValueError(f"sum of the taps: expected 1, got {total:g}")
        self.taps: Sequence[float] = tuple(tap / total for tap in taps)
        self._history: deque[float] = deque([0.0] * len(self.taps), maxlen=len(self.taps))

    def step(self, command: float) -> float:
        """Return the output for this tick's command."""
        self._history.appendleft(command)
        return math.fsum(map(mul, self.taps, self._history))

    def response(self, weights: Sequence[float]) -> float:
        """Response to the commands so far with these taps instead, the newest command first."""
        return float(sum(map(mul, weights, self._history)))

    def reset_to_steady_state(self, command: float) -> None:
        """Set the memory as if the command had been constant for long."""
        self._history.extend([command] * (self._history.maxlen or 0))

    def lengthen(self, count: int) -> None:
        """Extend the memory of a filter that has not run to ``count`` commands."""
        self._history = deque([0.0] * count, maxlen=count)

    def copy_state(self, old: "Fir") -> None:
        """Copy the commands that another filter has seen; its oldest stands for older ones."""
        count = self._history.maxlen or 0
        seen = [*old._history, *[old._history[-1]] * count]
        self._history.extend(seen[:count])


def zv_taps(mode: SwayMode, tick_s: float) -> list[float]:
    """Zero vibration: two impulses half a swing apart, the second on two neighbouring ticks.

    Half a swing is no whole number of ticks; two taps around it, with the first and the sum, meet
    H(p) = 0 exactly (three real equations).
    """
    pole = mode.pole
    n = math.floor(0.5 * mode.period_s / tick_s + 1e-9)
    # 1 + a w_n + b w_(n+1) = 0 with w_k = exp(-p k T), then scaled to sum 1
    one, two = cmath.exp(-pole * n * tick_s), cmath.exp(-pole * (n + 1) * tick_s)
    determinant = one.real * two.imag - one.imag * two.real
    a, b = -two.imag / determinant, one.imag / determinant
    if abs(b) < 1e-9:  # half a swing is a whole number of ticks
        a, b = a + b, 0.0
    total = 1.0 + a + b
    taps = [0.0] * (n + 2)
    taps[0], taps[n], taps[n + 1] = 1.0 / total, a / total, b / total
    return taps if b else taps[:-1]


def stretched(taps: Sequence[float], factor: float) -> list[float]:
    """Return taps whose step response takes ``factor`` times as long; their sum stays the same.

    A tap stands for its whole tick: the step response is stretched in time, linear between ticks.
    """
    steps = [0.0, *accumulate(taps)]
    ticks = math.ceil((len(steps) - 1) * factor - 1e-9)

    def step(tick: int) -> float:
        at = min(tick / factor, len(steps) - 1.0)
        low = min(int(at), len(steps) - 2)
        return steps[low] + (at - low) * (steps[low + 1] - steps[low])

    response = [step(tick) for tick in range(ticks + 1)]
    return [max(after - before, 0.0) for before, after in pairwise(response)]


def convolved(first: Sequence[float], second: Sequence[float]) -> list[float]:
    """Return the taps of two shapers in series."""
    taps = [0.0] * (len(first) + len(second) - 1)
    for i, a in enumerate(first):
        if a:
            for k, b in enumerate(second):
                taps[i + k] += a * b
    return taps


def ei_taps(mode: SwayMode, tick_s: float, residual: float) -> list[float]:
    """Extra-insensitive: leave part ``residual`` of the swing at the nominal period, 0 next to it.

    Three impulses half a swing apart, (1+V)/4, (1-V)/2, (1+V)/4, each smaller by the decay of half
    a swing; between two ticks an impulse is shared linearly (error (omega T)^2 / 8 at most).
    """
    half = 0.5 * mode.period_s
    decay = math.exp(mode.pole.real * half)
    weights = (
        0.25 * (1.0 + residual),
        0.5 * (1.0 - residual) * decay,
        0.25 * (1.0 + residual) * decay**2,
    )
    taps = [0.0] * (math.ceil(2.0 * half / tick_s) + 1)
    for i, weight in enumerate(weights):
        place, share = divmod(i * half / tick_s, 1.0)
        taps[int(place)] += weight * (1.0 - share) / math.fsum(weights)
        if share:
            taps[int(place) + 1] += weight * share / math.fsum(weights)
    return taps


def _zv(sway: SwayModel) -> Shaper:
    return Fir(zv_taps(sway.mode, sway.tick_s))


def _zvd(sway: SwayModel) -> Shaper:
    zv = zv_taps(sway.mode, sway.tick_s)
    return Fir(convolved(zv, zv))


def _ei(sway: SwayModel, *, residual_pct: float) -> Shaper:
    return Fir(ei_taps(sway.mode, sway.tick_s, residual_pct / 100.0))


def _two_mode(sway: SwayModel, *, period_s: float, damping_ratio: float) -> Shaper:
    try:
        second = SwayModel(SwayMode.from_period(period_s, damping_ratio), sway.tick_s).mode
    except ValueError as error:
        raise ValueError(f"second mode: {error}") from None
    return Fir(convolved(zv_taps(sway.mode, sway.tick_s), zv_taps(second, sway.tick_s)))


KINDS = (
    ShaperKind(
        "zv",
        "Zero vibration: two impulses, half a swing apart.",
        _zv,
        lambda _mode, _tick_s: {"ZV": {}},
        needs_sway=True,
        runs_ahead=False,
    ),
    ShaperKind(
        "zvd",
        "Zero vibration and derivative: ZV twice, forgives more error of the period.",
        _zvd,
        lambda _mode, _tick_s: {"ZVD": {}},
        needs_sway=True,
        runs_ahead=False,
    ),
    ShaperKind(
        "ei",
        "Extra-insensitive: leaves some swing at the nominal period, none next to it.",
        _ei,
        lambda _mode, _tick_s: {"EI 5 %": {"residual_pct": 5.0}},
        (Parameter("residual_pct", 0.1, 20, "%", "swing left at the nominal period", default=5.0),),
        needs_sway=True,
        runs_ahead=False,
    ),
    ShaperKind(
        "two_mode",
        "ZV for the sway of the axis and for a second mode, such as a log in the grapple.",
        _two_mode,
        lambda mode, _tick_s: {
            "two-mode": {"period_s": 0.4 * mode.period_s, "damping_ratio": 0.02}
        },
        (
            Parameter("period_s", 0.15, 25, "s", "period of the second mode"),
            Parameter("damping_ratio", 0, 0.95, "", "damping ratio of the second mode"),
        ),
        needs_sway=True,
        runs_ahead=False,
    ),
)
