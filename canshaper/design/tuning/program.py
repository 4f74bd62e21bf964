"""Eq. 14-15 as a nonlinear programme for IPOPT, built with CasADi.

The unknowns are z = [ln q1, ln(q2/q1), (ln(q3/q2))] with the poles -q_i, slowest first. Eq. 14d is
z_2, z_3 >= 0, and 14e becomes a bound on z_1 (or on the sum of z):
docs/decisions.md#poles-as-logarithms.

The cost uses Eq. 13 sampled exactly: u is held over a tick, so a chain of first-order lags gives v
= u / (a2 s^2 + a1 s + 1) by a matrix exponential that also holds for a double pole, and y = v + b1
v' + b2 v''. The requirements apply to the filter as it is deployed, state feedback on the sampled
sway model (``canshaper.shaping.shapers.gff``), so that they hold for the sent frames.
"""

import math
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from canshaper.design.tuning.formulation import OVER_COMMAND, SETTLED, Task, at_length, lengths
from canshaper.shaping.sway import SwayModel

Vector = NDArray[np.float64]

# Enough for exp(M) with entries of M up to 1 in a chain of three: next term below 1e-17.
_TAYLOR_TERMS = 24
# Lengths at which the residual is bounded; it is smooth and largest at the ends.
_LENGTHS = 13
# Written out sample by sample a programme solves four times as fast; beyond so many samples
# writing it out takes longer than that saves.
_EXPANDED = 5000
_IPOPT: dict[str, Any] = {
    "print_time": 0,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-10,
    "ipopt.acceptable_tol": 1e-8,
    "ipopt.max_iter": 300,
    "ipopt.bound_relax_factor": 0.0,
}


@dataclass(frozen=True, slots=True)
class Row:
    """A requirement: its name, its expression (a column), and the bounds of each entry."""

    name: str
    value: Any
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Solution:
    """Result of one run of IPOPT.

    Attributes:
        z: the unknowns, [ln q1, ln(q2/q1), ...].
        cost: value of the cost.
        active: names of the requirements that bound the solution.
        success: IPOPT reports success.
    """

    z: Vector
    cost: float
    active: tuple[str, ...]
    success: bool


class Program:
    """The programme of one task; ``solve`` runs it from a start.

    Raises:
        ValueError: the sway mode is too fast for the tick.
    """

    def __init__(self, task: Task) -> None:
        self.task = task
        n = self.size = task.pole_count
        self.low = np.array([math.log(task.slowest()[0]), *[0.0] * (n - 1)])
        span = math.log(task.fastest()[0]) - self.low[0]
        self.high = np.array([self.low[0] + span, *[max(span, 0.0)] * (n - 1)])
        z = ca.MX.sym("z", n)
        worst = ca.MX.sym("worst", 0 if task.length_range_pct is None else 1)
        q = ca.exp(ca.cumsum(z))
        response = _deployed_response(task, n)
        self._response = response
        self.rows = self._requirements(z, q, response, worst)
        count = [row.value.numel() for row in self.rows]
        self._low = np.repeat([row.low for row in self.rows], count)
        self._high = np.repeat([row.high for row in self.rows], count)
        self._names = np.repeat([row.name for row in self.rows], count)
        cost = worst if task.length_range_pct is not None else _cost(task, z)
        self._cost = ca.Function(
            "cost", [z], [ca.mmax(_residuals(task, q)) if worst.numel() else cost]
        )
        limit = [] if worst.numel() else [cost]
        # One programme for the optimum (weight 1 on the cost) and for how far each pole may go
        # at a given cost (weight 0, direction on ln q).
        weight = ca.MX.sym("weight", 1 + n)
        self._epigraph = worst.numel()
        problem: Any = {
            "x": ca.vertcat(z, worst),
            "p": weight,
            "f": weight[0] * cost + ca.dot(weight[1:], ca.cumsum(z)),
            "g": ca.vertcat(*(row.value for row in self.rows), *limit),
        }
        self._solver: Any = ca.nlpsol(
            "tune", "ipopt", problem, _IPOPT | {"expand": task.samples <= _EXPANDED}
        )

    def solve(
        self,
        start: Vector,
        *,
        direction: tuple[float, ...] | None = None,
        cost_limit: float = math.inf,
    ) -> Solution:
        """Run IPOPT.

        Args:
            start: z of the start.
            direction: if given, minimise its scalar product with the ln q_i in place of the cost.
            cost_limit: largest allowed cost.
        """
        n = self.size
        extra = [self.cost(start)] if self._epigraph else []
        top = [cost_limit] if self._epigraph else []
        limit = [] if self._epigraph else [cost_limit]
        answer = self._solver(
            x0=[*start, *extra],
            lbx=[*self.low, *[0.0] * self._epigraph],
            ubx=[*self.high, *top],
            lbg=[*self._low, *[-math.inf] * len(limit)],
            ubg=[*self._high, *limit],
            p=[1.0, *[0.0] * n] if direction is None else [0.0, *direction],
        )
        stats = self._solver.stats()
        z = answer["x"].full().ravel()[:n]
        active = self._active(answer, z)
        return Solution(z, self.cost(z), active, stats["success"])

    def cost(self, z: Vector) -> float:
        """Return the cost of the setting ``z``, also where it breaks requirements."""
        return float(self._cost(z))

    def response(self, z: Vector) -> Vector:
        """Return the response of the deployed filter to a unit step, one value for each tick."""
        return np.asarray(self._response(z).full()).ravel()

    def _requirements(self, z: Any, q: Any, response: Any, worst: Any) -> list[Row]:
        task, n, require = self.task, self.size, self.task.require
        top = math.log(max(task.fastest()[0], task.slowest()[0]))
        rows = [Row(task.fastest()[1], ca.sum1(z), -math.inf, top)]
        y = response(z)
        if n == 2:
            jump = task.mode.omega_rad_s**-2 * q[0] * q[1]
            # With two real poles the response passes the command only by its first jump.
            if require.within_command:
                rows.append(Row("within the command", jump, -math.inf, 1.0))
        else:
            jump = y[0]
            if require.within_command:
                rows.append(Row("within the command", y, -math.inf, 1.0 + OVER_COMMAND))
            if require.max_rate_per_s is not None:
                step = require.max_rate_per_s * task.tick_s
                change = y - ca.vertcat(0.0, y[:-1])
                rows.append(Row("rate of the valve", change / step, -1.0, 1.0))
        if require.max_jump is not None:
            rows.append(Row("first jump", jump, -math.inf, require.max_jump))
        if require.max_run_on_s is not None:
            first = int(require.max_run_on_s / task.tick_s + 1e-9)
            # A hair inside, so that the digits of a file do not cost a tick.
            rows.append(Row("run-on", (y[first:] - 1.0) / (0.999 * SETTLED), -1.0, 1.0))
        if worst.numel():
            rows.append(Row("", _residuals(task, q) - worst, -math.inf, 0.0))
        return rows

    def _active(self, answer: Any, z: Vector) -> tuple[str, ...]:
        """Return the requirements at their bound whose multiplier is not zero."""
        names: dict[str, None] = {}
        if any(np.expm1(z[1:]) < 1e-2):
            names["real poles (14d)"] = None
        if z[0] - self.low[0] < 1e-4 and self.task.slowest()[0] < self.task.fastest()[0]:
            names[self.task.slowest()[1]] = None
        g, force = (answer[key].full().ravel() for key in ("g", "lam_g"))
        slack = np.minimum(self._high - g[: len(self._high)], g[: len(self._low)] - self._low)
        for i in np.flatnonzero((slack < 1e-4) & (abs(force[: len(slack)]) > 1e-7)):
            names[str(self._names[i])] = None
        return tuple(name for name in names if name)


def _chain(task: Task, n: int) -> Any:
    """Return q -> [Ad | Bd] of v_i' = q_i (v_(i-1) - v_i), v_0 = u held over a tick."""
    q = ca.SX.sym("q", n)
    m = ca.SX(n + 1, n + 1)
    for i in range(n):
        m[i, i] = -q[i] * task.tick_s
        m[i, i - 1 if i else n] = q[i] * task.tick_s
    exponential = ca.SX.eye(n + 1)
    for k in range(_TAYLOR_TERMS, 0, -1):
        exponential = ca.SX.eye(n + 1) + ca.mtimes(m, exponential) / k
    return ca.Function("chain", [q], [ca.densify(exponential[:n, :])])


def _cost(task: Task, z: Any) -> Any:
    """Return Eq. 15 for a unit step: the mean over the N samples."""
    n, w, weights = task.pole_count, task.mode.omega_rad_s, task.weights
    b1, b2 = 2.0 * task.mode.damping_ratio / w, 1.0 / w**2
    x, q, chain = ca.SX.sym("x", n + 2), ca.SX.sym("q", n), ca.SX.sym("chain", n, n + 1)
    v, y_before, total = x[:n], x[n], x[n + 1]
    rate = [q[i] * ((v[i - 1] if i else 1.0) - v[i]) for i in range(n)]
    rate_2 = q[n - 1] * (rate[n - 2] - rate[n - 1])
    y = v[n - 1] + b1 * rate[n - 1] + b2 * rate_2
    a2 = 1.0 / (q[0] * q[1])
    choices: dict[str, tuple[Any, Any]] = {
        "sway": (rate[n - 1] / w, rate_2 / w**2),
        "deviation": (v[n - 1] - 1.0, rate[n - 1]),
        "companion": (a2 * v[n - 1], a2 * rate[n - 1]),
        "none": (0.0, 0.0),
    }
    x1, x2 = choices[task.states]
    q11, q12, q22 = weights.matrix
    stage = (
        q11 * x1**2
        + 2.0 * q12 * x1 * x2
        + q22 * x2**2
        + weights.r * (y - 0.95) ** 2
        + weights.s * (y - 1.0) ** 2
        + weights.p * (y - y_before) ** 2
    )
    following = ca.vertcat(ca.mtimes(chain, ca.vertcat(v, 1.0)), y, total + stage)
    step = ca.Function("sample", [x, q, chain], [following])
    poles = ca.exp(ca.cumsum(z))
    count = task.samples
    end = step.fold(count)(
        ca.DM.zeros(n + 2),
        ca.repmat(poles, 1, count),
        ca.repmat(_chain(task, n)(poles), 1, count),
    )
    return end[n + 1] / count


def _deployed_response(task: Task, n: int) -> Any:
    """Return the function z -> response of ``Gff`` to a unit step, until after the horizon.

    The first two poles belong to the state feedback, the third to the lag of the command.
    """
    z = ca.SX.sym("z", n)
    sway = SwayModel(task.mode, task.tick_s)
    increments = ca.exp(-ca.exp(ca.cumsum(z)) * task.tick_s) - 1.0
    det = sway.f11 * sway.f22 - sway.f12 * sway.f21
    dc = increments[0] * increments[1] / det
    k2 = 1.0 - dc
    k1 = (sway.f11 + sway.f22 * dc - increments[0] - increments[1]) / sway.f12
    share = -increments[2] if n == 3 else 1.0
    x, gains = ca.SX.sym("x", 3), ca.SX.sym("gains", 3)
    command = x[2] + gains[2] * (1.0 - x[2])
    y = command - gains[0] * x[0] - gains[1] * (x[1] + command)
    swing = x[1] + y
    following = ca.vertcat(
        x[0] + sway.f11 * x[0] + sway.f12 * swing,
        x[1] + sway.f21 * x[0] + sway.f22 * swing,
        command,
    )
    watched_s = max(task.horizon_s, (task.require.max_run_on_s or 0.0) + 1.0)
    count = round(watched_s / task.tick_s)
    step = ca.Function("tick", [x, gains], [following, y])
    zm = ca.MX.sym("z", n)
    of_point = ca.Function("gains", [z], [ca.vertcat(k1, k2, share)])(zm)
    outputs = step.mapaccum(count)(ca.DM.zeros(3), ca.repmat(of_point, 1, count))[1]
    return ca.Function("response", [zm], [outputs.T])


def _residuals(task: Task, q: Any) -> Any:
    """Return |H(e^(pT))| of the deployed filter at the sway poles p over the range of lengths."""
    assert task.length_range_pct is not None
    tick = task.tick_s
    zero = np.exp(task.mode.pole * tick)
    result = []
    for factor in lengths(task.length_range_pct, _LENGTHS):
        at = np.exp(at_length(task.mode, factor).pole * tick)
        gain = abs((at - zero) * (at - np.conj(zero))) / abs(1.0 - zero) ** 2
        lag = 1.0
        for i in range(q.numel()):
            e = ca.exp(-q[i] * tick)
            lag *= (1.0 - e) / ca.sqrt((at.real - e) ** 2 + at.imag**2)
        # The lag of the command answers in the tick of the step.
        result.append(gain * lag * (abs(at) if q.numel() == 3 else 1.0))
    return ca.vertcat(*result)
