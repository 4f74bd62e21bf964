"""A sway sensor against the model of its axis: least squares over delay, frequency and decay.

The tip follows its command with the lag that the deployment names, and drives the pendulum as in
`canshaper.shaping.sway`. The sensor shows that swing after a delay, times a gain with a sign. Each
stretch of driving has a free swing and an offset of its own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np
from scipy.signal import lfilter

from canshaper.commissioning.identification.canlog import read_can
from canshaper.commissioning.identification.decay import covariance_of, free_columns
from canshaper.commissioning.identification.driven import (
    SHORTEST_LAG_S,
    Driven,
    DrivenProblem,
    gain_of,
    swing_filter,
)
from canshaper.commissioning.identification.series import Array, Series
from canshaper.machine.deployment import Deployment
from canshaper.shaping.sway import SwayMode
from canshaper_sim.strokes import Script, Stroke

# Range of delays, s; a valve that is quicker than the deployment says makes one negative.
LEAST_DELAY_S, MOST_DELAY_S = -0.2, 0.7
# Range of the frequency of the swing, as a part of that of the deployment.
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
        square: sum of squares of the data without free swings; ``left``: of its residual.
        count: number of measurements.
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
        """Return the part of a signal beyond noise, rad or rad/s, that commands explain; else 0."""
        beyond = self.square - self.count * noise**2
        return 1.0 - max(0.0, self.left - self.count * noise**2) / beyond if beyond > 0.0 else 0.0


def fit_sensor(data: Sequence[Driven], mode: SwayMode, lag_s: float) -> SensorFit:
    """Fit the stretches of an axis.

    Args:
        data: the stretches, of an angle or of a rate; at least one.
        mode: swing by the deployment.
        lag_s: time constant of the valve by the deployment.
    """
    pole = mode.pole
    low = [LEAST_DELAY_S, SLOWEST * pole.imag, 0.0]
    high = [MOST_DELAY_S, FASTEST * pole.imag, 0.6 * pole.imag]
    scale = [0.1, 0.1 * pole.imag, 0.05 * pole.imag]
    starts = [[start, pole.imag, -pole.real] for start in STARTS_S]
    model = partial(_model, data, [*map(_held, data)], max(lag_s, SHORTEST_LAG_S))
    problem = DrivenProblem(data, model, low, high, scale, starts)
    return _result(problem, problem.solved(*starts))


def _model(
    data: Sequence[Driven], commands: Sequence[tuple[Array, Array]], lag_s: float, x: Array
) -> list[tuple[Array, Array]]:
    """Return for each stretch: swing by commands at 1 m/s, and free swing with an offset."""
    delay_s, omega, sigma = map(float, x)
    parts = []
    for one, (grid, speed) in zip(data, commands, strict=True):
        swing = lfilter(*swing_filter(omega, sigma, lag_s, one.kind, GRID_S), speed - speed[0])
        time = one.time_s
        free = free_columns(time, omega * time, np.exp(-sigma * time))[:, :3]  # without a drift
        parts.append((np.interp(time - delay_s, grid, swing), free))
    return parts


def _held(one: Driven) -> tuple[Array, Array]:
    """Return a grid of times since the stretch's start, s, and the parts of full speed on it."""
    first, last = float(one.command.time_s[0]) - one.start_s, float(one.time_s[-1])
    grid = np.arange(first, last - LEAST_DELAY_S + GRID_S, GRID_S)
    return grid, one.command.at(one.start_s + grid + 1e-6)


def _result(problem: DrivenProblem, x: Array) -> SensorFit:
    data, gain, fits = problem.data, gain_of(problem.projected(x)), problem.fitted(x)
    delay_s, omega, sigma = map(float, x)
    covariance, _ = covariance_of(
        lambda y: problem.residual(y[:3], gain * float(y[3])),
        np.append(x, 1.0),
        np.array([3e-3, 1e-3, 1e-3, 1e-3]),
        data,
        omega,
    )
    square, left = problem.squares(x)
    delay, faster, decay, size = np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist()
    return SensorFit(
        gain=gain,
        delay_s=delay_s,
        omega=omega,
        sigma=sigma,
        offsets=np.array([amounts[2] for _, amounts in fits]),
        fitted=[model for model, _ in fits],
        square=square,
        left=left,
        count=sum(len(one.time_s) for one in data),
        deviations=(delay, faster, decay, size),
    )


def read_sensors(path: Path, deployment: Deployment, axes: Sequence[str]) -> dict[str, Series]:
    """Read the measurements of some axes' sensors; axes without one are left out.

    Raises:
        IdentificationError: a sensor is not in the log, or from two senders.
        LogError: the log cannot be read.
    """
    sensors = {name: s for name in axes if (s := deployment.axes[name].sway_sensor)}
    return read_can(
        path,
        {name: one.name for name, one in sensors.items()},
        deployment.messages,
        deployment=deployment,
        sources={name: one.config.source for name, one in sensors.items()},
    )


# A drive as a person is asked for: slow strokes forth and back, with pauses of two swings.
FIRST_S, STROKE_S, PAUSE_S, LEVEL, STROKES = 2.0, 1.0, 4.0, 0.4, 4


def hand_driven(axes: Sequence[str]) -> Script:
    """Return a script of slow strokes, of one axis after the other."""
    strokes, start_s = [], FIRST_S
    for axis in axes:
        for number in range(STROKES):
            strokes.append(Stroke(axis, start_s, STROKE_S, -LEVEL if number % 2 else LEVEL))
            start_s += STROKE_S + PAUSE_S
    return Script("sensor", tuple(strokes), start_s + PAUSE_S)
