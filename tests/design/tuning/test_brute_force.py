"""The optimum of 100 random weightings against every point of a grid that closes in.

Eq. 15 in numpy on whole grids of poles: companion form and matrix exponential. The horizon is 1.5
to 8 s, so that the tail of the response is in the sum as well.
"""

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import expm

from canshaper.design.tuning.formulation import Requirements, States, Task, Weights
from canshaper.design.tuning.optimal import tune
from canshaper.shaping.sway import SwayMode

WEIGHTINGS = 100
WITHIN = 1e-6
ROUNDS = {2: 8, 3: 16}
Array = NDArray[np.float64]


def drawn(seed: int) -> Task:
    """A task with random weights, swing, tick and horizon; each fifth has three poles."""
    draw = np.random.default_rng(seed)

    def log(low: float, high: float) -> float:
        return float(np.exp(draw.uniform(math.log(low), math.log(high))))

    q11, q22, turn = log(0.01, 100.0), log(0.01, 100.0), draw.uniform(-1.0, 1.0)
    q12 = turn * math.sqrt(q11 * q22)
    q = [(q11,), (q11, q22), (q11, q12, q12, q22), (0.0,)][draw.integers(4)]
    r, s = [(log(0.1, 30.0), 0.0), (0.0, log(0.1, 30.0)), (1.0, 3.0)][draw.integers(3)]
    weights = Weights(q, r, s, [0.0, log(0.01, 100.0)][draw.integers(2)])
    states: States = ("sway", "deviation", "companion", "none")[draw.integers(4)]  # type: ignore[assignment]
    three = seed % 5 == 0
    require = Requirements(
        within_command=not three and bool(draw.integers(2)),
        max_rate_per_s=[None, log(0.3, 10.0)][0 if three else draw.integers(2)],
        third_pole=three,
    )
    mode = SwayMode(math.sqrt(9.81 / log(0.3, 20.0)), draw.uniform(0.0, 0.15))
    tick_s = float(draw.choice([0.02, 0.04]))
    return Task(mode, tick_s, draw.uniform(1.5, 8.0), weights, states, require)


def costs(task: Task, q: Array) -> Array:
    """Eq. 15 of settings, one a row: the poles, rad/s, positive."""
    n, w = q.shape[1], task.mode.omega_rad_s
    # Of the product of all (s/q + 1): c0 = 1, c1, ...
    c = np.zeros((len(q), n + 1))
    c[:, 0] = 1.0
    for i in range(n):
        c[:, 1:] += c[:, :-1] / q[:, i : i + 1]
    system = np.zeros((len(q), n + 1, n + 1))
    system[:, range(n - 1), range(1, n)] = 1.0
    system[:, n - 1, :n] = -c[:, :n] / c[:, n:]
    system[:, n - 1, n] = 1.0 / c[:, n]
    step = expm(system * task.tick_s)
    x = np.zeros((len(q), n + 1))
    x[:, n] = 1.0
    total, before = np.zeros(len(q)), np.zeros(len(q))
    a2 = 1.0 / (q[:, 0] * q[:, 1])
    q11, q12, q22 = task.weights.matrix
    for _ in range(task.samples):
        v, rate = x[:, 0], x[:, 1]
        rate_2 = x[:, 2] if n == 3 else (system[:, 1] * x).sum(axis=1)
        y = v + 2.0 * task.mode.damping_ratio / w * rate + rate_2 / w**2
        x1, x2 = {
            "sway": (rate / w, rate_2 / w**2),
            "deviation": (v - 1.0, rate),
            "companion": (a2 * v, a2 * rate),
            "none": (0.0 * v, 0.0 * v),
        }[task.states]
        total += (
            q11 * x1**2 + 2.0 * q12 * x1 * x2 + q22 * x2**2 + task.weights.p * (y - before) ** 2
        )
        total += task.weights.r * (y - 0.95) ** 2 + task.weights.s * (y - 1.0) ** 2
        before, x = y, np.matmul(step, x[:, :, None])[:, :, 0]
    return total / task.samples


def least(task: Task) -> tuple[float, Array]:
    """Least cost on grids of the poles' logarithms, each around the best point of the last."""
    n = task.pole_count
    low = np.array([math.log(task.slowest()[0]), *[0.0] * (n - 1)])
    top = math.log(task.fastest()[0])
    high = np.array([top, *[top - low[0]] * (n - 1)])
    box, best, at = (low, high), math.inf, low
    most = 2.0 * math.log(task.mode.omega_rad_s) if task.require.within_command else math.inf
    for number in range(ROUNDS[n]):
        first, then = ((61, 31), (31, 31)) if n == 2 else ((25, 9, 9), (11, 11, 11))
        counts = then if number else first
        axes = [np.linspace(a, b, m) for a, b, m in zip(low, high, counts, strict=True)]
        z = np.array([*itertools.product(*axes)])
        # Where the fastest pole, and the first jump, are the largest allowed.
        edges = [np.column_stack([z[:, :-1], top - z[:, :-1].sum(axis=1)])]
        if task.require.within_command:
            edges.append(np.column_stack([axes[0], most - 2.0 * axes[0]]))
        z = np.vstack([z, *edges])
        inside = (z[:, -1] >= 0.0) & (z.sum(axis=1) <= top + 1e-12)
        z = z[inside & (2.0 * z[:, 0] + z[:, 1] <= most + 1e-12)]
        found = costs(task, np.exp(np.cumsum(z, axis=1)))
        if found.min() < best:
            best, at = float(found.min()), z[found.argmin()]
        width = [3.0 * (b - a) / (m - 1) for a, b, m in zip(low, high, counts, strict=True)]
        low, high = np.maximum(box[0], at - width), np.minimum(box[1], at + width)
    return best, np.exp(np.cumsum(at))


@pytest.mark.study
@pytest.mark.parametrize("seed", range(WEIGHTINGS))
def test_a_weighted_optimum_is_that_of_brute_force(seed: int) -> None:
    task = drawn(seed)
    tuning = tune(task)
    best, at = least(task)
    poles = [-p for p in (*tuning.poles_rad_s, tuning.third_pole_rad_s) if p is not None]
    own = float(costs(task, np.array([poles]))[0])
    assert tuning.cost == pytest.approx(own, rel=1e-6)
    assert own <= best * (1.0 + WITHIN), f"{poles} for {at}"
    assert best <= own * (1.0 + 10.0 * WITHIN)  # the grid is fine enough to say so
