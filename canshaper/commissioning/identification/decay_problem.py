"""Least squares of free swings over a common frequency and decay.

In a free swing of a pendulum with small damping

    y = exp(-s t) (a cos p + b sin p) + c + d t,    p = w (t - A^2/16 * integral exp(-2 s t) dt)

with the amplitude A in rad: a large swing takes longer (T = T0 (1 + A^2/16)). Frequency w and decay
s are common to all segments; a, b, c and d belong to each and are eliminated (variable projection,
Golub and Pereyra 1973), so two unknowns remain.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.optimize import least_squares

from canshaper.commissioning.identification.series import Array, Kind

# Beyond this no tool swings, and its unit is wrong.
LARGEST_RAD: Final = math.radians(100.0)
# Frequencies at which the noise is looked at; more show no more.
MOST_FREQUENCIES: Final = 80


@dataclass(frozen=True, slots=True)
class Segment:
    """A stretch of free swing.

    Attributes:
        source: file and signal.
        start_s: its start in the log, s.
        time_s: times from its start, s.
        value: rad, rad/s or the signal's own unit.
        kind: which of them.
    """

    source: str
    start_s: float
    time_s: Array
    value: Array
    kind: Kind


class DecayProblem:
    """Least squares of several segments over common parameters.

    Parameters: frequency w in rad/s, decay s in 1/s, and on request a dry friction, the part of
    the segment's ``scale`` that the amplitude loses in a second besides.
    """

    def __init__(self, segments: Sequence[Segment], amplitudes: Sequence[float]) -> None:
        self.segments = segments
        self.amplitudes = list(amplitudes)  # at the start of each segment, in its unit
        self.weights = [1.0] * len(segments)

    def basis(self, i: int, x: Array, at: Array | None = None) -> tuple[Array, Array]:
        """Columns of the linear parameters of a segment, and the envelope that starts at 1.

        Args:
            i: which segment.
            x: the parameters.
            at: times from the start of the segment; by default its own.
        """
        end = self.segments[i].time_s[-1]
        time = self.segments[i].time_s if at is None else at
        omega, sigma = float(x[0]), float(x[1])
        envelope = np.exp(-sigma * time)
        if len(x) > 2:
            lost = -np.expm1(-sigma * time) / sigma if sigma else time
            envelope = np.maximum(envelope - float(x[2]) / self.amplitudes[i] * lost, 0.0)
        angle = self._angle(i, omega, sigma)
        stretched = time
        if angle:
            if len(x) > 2:
                slower = cumulative_trapezoid(envelope**2, time, initial=0.0)
            else:
                slower = -np.expm1(-2.0 * sigma * time) / (2.0 * sigma) if sigma else time
            stretched = time - angle**2 / 16.0 * slower
        phase = omega * stretched
        drift = time - 0.5 * end
        columns = [envelope * np.cos(phase), envelope * np.sin(phase), np.ones_like(time), drift]
        return np.stack(columns, axis=1), envelope

    def _angle(self, i: int, omega: float, sigma: float) -> float:
        """Amplitude at the start of a segment in rad, 0 where it is not known or cannot be."""
        kind, amplitude = self.segments[i].kind, self.amplitudes[i]
        if kind is Kind.OTHER:
            return 0.0
        angle = amplitude if kind is Kind.ANGLE else amplitude / math.hypot(omega, sigma)
        return angle if angle < LARGEST_RAD else 0.0

    def linear(self, i: int, x: Array) -> tuple[Array, Array, Array]:
        """Basis, best linear parameters and residual of a segment."""
        basis, _ = self.basis(i, x)
        best, *_ = np.linalg.lstsq(basis, self.segments[i].value, rcond=None)
        return basis, np.asarray(best), self.segments[i].value - basis @ best

    def residual(self, x: Array) -> Array:
        """Weighted residuals of all segments."""
        parts = [self.linear(i, x)[2] * self.weights[i] for i in range(len(self.segments))]
        return np.concatenate(parts)

    def solve(self, x: Sequence[float], *, roughly: bool = False) -> Array:
        """Parameters of least squares, from a start; roughly, to some parts in a thousand."""
        now = np.asarray(x, dtype=np.float64)
        omega = float(now[0])
        low = np.array([0.6 * omega, -0.2 * omega, -np.inf])[: len(now)]
        high = np.array([1.6 * omega, omega, np.inf])[: len(now)]
        now = np.clip(now, low, high)
        scale = np.array([0.01 * now[0], 0.01 * now[0], 0.01 * max(self.amplitudes)])
        for _ in range(1 if roughly else 3):  # amplitudes and weights follow, and settle at once
            now = least_squares(
                self.residual,
                now,
                x_scale=scale[: len(now)],
                bounds=(low, high),
                ftol=1e-4 if roughly else 1e-8,
                max_nfev=30 if roughly else 100,
            ).x
            for i in range(len(self.segments)):
                _, best, residual = self.linear(i, now)
                size = math.hypot(best[0], best[1])
                self.amplitudes[i] = max(size, 1e-12)
                if len(self.segments) > 1:
                    time = self.segments[i].time_s
                    noise = math.sqrt(density(time, residual, float(now[0]))[0])
                    self.weights[i] = 1.0 / max(noise, 1e-4 * size, 1e-12)
        return now

    def covariance(self, x: Array) -> tuple[Array, float]:
        """Covariance of the parameters, and the degrees of freedom it rests on.

        What matters of the noise is its density at the frequency of the swing; that is taken from
        the residual's spectrum around it, so noise that is not white gives no wrong interval.
        """
        n = len(x)
        curvature, meat, freedom = np.zeros((n, n)), np.zeros((n, n)), 0.0
        for i, segment in enumerate(self.segments):
            basis, best, residual = self.linear(i, x)
            columns = []
            for j in range(n):
                step = np.zeros(n)
                step[j] = 1e-5 * x[0]
                up, down = self.basis(i, x + step)[0], self.basis(i, x - step)[0]
                columns.append((up - down) @ best / (2.0 * step[j]))
            slope = np.stack(columns, axis=1)
            q, _ = np.linalg.qr(basis)
            slope -= q @ (q.T @ slope)
            information = slope.T @ slope * self.weights[i] ** 2
            power, count = density(segment.time_s, residual, float(x[0]))
            curvature += information
            meat += information * power * self.weights[i] ** 2
            freedom += count
        inverse = np.linalg.pinv(curvature)
        return inverse @ meat @ inverse, max(freedom, 3.0)


def density(time: Array, residual: Array, omega: float) -> tuple[float, float]:
    """Power of the residual around a frequency, white noise has its variance; and its freedom."""
    length = float(time[-1] - time[0])
    resolution = 2.0 * math.pi / length
    near = np.arange(0.5 * omega, 1.8 * omega, 0.5 * resolution)
    near = near[np.abs(near - omega) > 0.75 * resolution]
    if len(near) < 4:
        near = np.arange(omega + 0.75 * resolution, 3.0 * omega + 3.0 * resolution, resolution / 2)
    if len(near) > MOST_FREQUENCIES:
        near = near[:: len(near) // MOST_FREQUENCIES + 1]
    spectrum = np.abs(np.exp(-1j * np.outer(near, time)) @ residual) ** 2 / len(time)
    # The fit has taken its own part out of the residual.
    lost = len(time) / max(len(time) - 6, 1)
    return float(np.mean(spectrum)) * lost, len(near)
