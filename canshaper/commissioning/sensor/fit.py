"""A sway sensor against the model of its axis: least squares over delay, frequency and decay.

The tip follows its command with the lag that the deployment names, and drives the pendulum as in
`canshaper.shaping.sway`; the sensor shows that swing so much later, times a gain, whose sign is its
own. Each stretch of driving has a free swing and an offset of its own too.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lfilter

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.driven_data import (
    SHORTEST_LAG_S,
    Driven,
    covariance_of,
    free_columns,
    gain_of,
    squares_of,
    swing_filter,
)
from canshaper.commissioning.identification.series import Array, Series
from canshaper.machine.deployment import Deployment
from canshaper.shaping.sway import SwayMode
from canshaper_sim.strokes import Script, Stroke

# Delays that are looked for; a valve that is quicker than the deployment says makes it negative.
LEAST_DELAY_S, MOST_DELAY_S = -0.2, 0.7
# The same of the frequency of the swing, as a part of that of the deployment.
SLOWEST, FASTEST = 0.6, 1.6
GRID_S: Final = 0.005
# Delays from which the solver starts: half a swing further it would find the other sign.
STARTS_S = (0.0, 0.15, 0.3)


@dataclass(frozen=True, slots=True)
class SensorFit:
    """Best fit of the measurements.

    Attributes:
        gain: measured per swing of the model at a full speed of 1 m/s; negative with another sign.
        delay_s: age of a measurement.
        omega, sigma: frequency and decay of the swing, rad/s, 1/s.
        offsets: of each stretch, rad or rad/s.
        fitted: the model, for each stretch.
        square: sum of squares of what no free swing explains; ``left`` of that beyond the model.
        count: measurements.
        deviations: standard deviations of delay (s), frequency, decay, and relative of the gain.
    """

    gain: float
    delay_s: float
    omega: float
    sigma: float
    offsets: Array
    fitted: list[Array]
    square: float
    left: float
    count: int
    deviations: tuple[float, float, float, float]

    def explained(self, noise: float) -> float:
        """Part of what is beyond noise, rad or rad/s, that the commands explain."""
        beyond = self.square - self.count * noise**2
        return 1.0 - max(0.0, self.left - self.count * noise**2) / beyond if beyond > 0.0 else 0.0


def fit_sensor(data: Sequence[Driven], mode: SwayMode, lag_s: float) -> SensorFit:
    """Fit the stretches of an axis.

    Args:
        data: the stretches, of an angle or of a rate; at least one.
        mode: swing by the deployment.
        lag_s: time constant of the valve.
    """
    problem = _Problem(data, mode, max(lag_s, SHORTEST_LAG_S))
    fits = [problem.solved(start) for start in STARTS_S]
    return problem.result(min(fits, key=lambda fit: float(fit.cost)).x)


class _Problem:
    """Least squares over (delay, frequency, decay); the rest is linear and eliminated."""

    def __init__(self, data: Sequence[Driven], mode: SwayMode, lag_s: float) -> None:
        self._data, self._lag_s = data, lag_s
        pole = mode.pole
        self._start = [pole.imag, -pole.real]
        self._bounds = (
            [LEAST_DELAY_S, SLOWEST * pole.imag, 0.0],
            [MOST_DELAY_S, FASTEST * pole.imag, 0.6 * pole.imag],
        )
        self._commands = [_held(one) for one in data]

    def solved(self, delay_s: float) -> Any:
        """Return the solution of SciPy from a delay."""
        start = np.array([delay_s, *self._start])
        scale = [0.1, 0.1 * self._start[0], 0.05 * self._start[0]]
        bounds = self._bounds
        return least_squares(self._residual, start, bounds=bounds, x_scale=scale, max_nfev=60)

    def _parts(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch: swing by commands at 1 m/s, and free swing with an offset."""
        delay_s, omega, sigma = map(float, x)
        filters = {
            kind: swing_filter(omega, sigma, self._lag_s, kind, GRID_S)
            for kind in {one.kind for one in self._data}
        }
        parts = []
        for one, (grid, speed) in zip(self._data, self._commands, strict=True):
            swing = lfilter(*filters[one.kind], speed - speed[0])
            driven = np.interp(one.time_s - delay_s, grid, swing)
            parts.append((driven, free_columns(one, omega, sigma)[:, :3]))  # without a drift
        return parts

    def _projected(self, x: Array) -> list[tuple[Array, Array]]:
        """Return for each stretch: driven swing and data, both without what free swings explain."""
        pairs = []
        for one, (driven, free) in zip(self._data, self._parts(x), strict=True):
            q, _ = np.linalg.qr(free)
            pairs.append((driven - q @ (q.T @ driven), one.value - q @ (q.T @ one.value)))
        return pairs

    def _residual(self, x: Array) -> Array:
        projected = self._projected(x)
        gain = gain_of(projected)
        return np.concatenate([y - gain * h for h, y in projected])

    def result(self, x: Array) -> SensorFit:
        """Return the fit at a solution."""
        projected = self._projected(x)
        gain = gain_of(projected)
        total, left = squares_of(projected)
        fitted, offsets = [], []
        for one, (driven, free) in zip(self._data, self._parts(x), strict=True):
            rest, *_ = np.linalg.lstsq(free, one.value - gain * driven, rcond=None)
            fitted.append(gain * driven + free @ rest)
            offsets.append(float(rest[2]))
        delay_s, omega, sigma = map(float, x)
        return SensorFit(
            gain,
            delay_s,
            omega,
            sigma,
            np.array(offsets),
            fitted,
            total,
            left,
            sum(len(one.time_s) for one in self._data),
            self._deviations(x, projected, gain),
        )

    def _deviations(
        self, x: Array, projected: Sequence[tuple[Array, Array]], gain: float
    ) -> tuple[float, float, float, float]:
        """Return the deviations, by the noise at the frequency of the swing."""
        columns = []
        for j in range(len(x)):
            step = np.zeros(len(x))
            step[j] = 1e-3 * (1.0 if j else 3.0)
            up, down = self._at(x + step, gain), self._at(x - step, gain)
            columns.append((up - down) / (2.0 * step[j]))
        columns.append(-np.concatenate([h for h, _ in projected]) * gain)
        slope = np.stack(columns, axis=1)
        covariance = covariance_of(slope, self._residual(x), self._data, float(x[1]))
        variances = np.diag(covariance)
        delay, omega, sigma, size = (math.sqrt(max(0.0, float(v))) for v in variances)
        return delay, omega, sigma, size

    def _at(self, x: Array, gain: float) -> Array:
        """Residual with a gain that stays."""
        return np.concatenate([y - gain * h for h, y in self._projected(x)])


def _held(one: Driven) -> tuple[Array, Array]:
    """Commanded speed on a grid that begins with a command: times from the stretch's, speeds."""
    command = one.command
    first = float(command.time_s[0]) - one.start_s
    grid = np.arange(first, float(one.time_s[-1]) - LEAST_DELAY_S + GRID_S, GRID_S)
    at = np.searchsorted(command.time_s - one.start_s, grid + 1e-6, side="right") - 1
    return grid, command.speed[np.maximum(at, 0)]


def read_sensors(path: Path, deployment: Deployment, axes: Sequence[str]) -> dict[str, Series]:
    """Read the measurements of the sensors of some axes.

    Raises:
        IdentificationError: a sensor is not in the log, or from two senders.
        LogError: the log cannot be read.
    """
    sensors = {name: s for name in axes if (s := deployment.axes[name].sway_sensor)}
    return read_can(
        path,
        "",
        {name: one.name for name, one in sensors.items()},
        deployment.messages,
        deployment=deployment,
        sources={name: one.config.source for name, one in sensors.items()},
    )


# As a person drives who is asked to: a slow stroke, a pause of two swings, and back.
FIRST_S, STROKE_S, PAUSE_S, LEVEL, STROKES = 2.0, 1.0, 4.0, 0.4, 4


def hand_driven(axes: Sequence[str]) -> Script:
    """Slow strokes of one axis after the other."""
    strokes, start_s = [], FIRST_S
    for axis in axes:
        for number in range(STROKES):
            strokes.append(Stroke(axis, start_s, STROKE_S, -LEVEL if number % 2 else LEVEL))
            start_s += STROKE_S + PAUSE_S
    return Script("sensor", tuple(strokes), start_s + PAUSE_S)
