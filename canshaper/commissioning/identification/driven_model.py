"""The swing that commands make, by a valve with a delay and a lag: the model of a driven swing.

The tip follows its command with a delay and a lag; its acceleration drives the pendulum,

    theta'' + 2 z w0 theta' + w0^2 theta = (w0^2 / g) V v',     v: command, V: full speed of the tip

as in `canshaper.shaping.sway`. Each stretch of driving has a free swing, an offset and a drift of
its own too.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.signal import lfilter

from canshaper.commissioning.identification.driven_data import Driven
from canshaper.commissioning.identification.series import BIN_S, Array, Kind
from canshaper.shaping.sway import GRAVITY_M_S2

SHORTEST_LAG_S: Final = 0.005  # of the model: without one it is another


def free_columns(one: Driven, omega: float, sigma: float) -> Array:
    """What a stretch may show without a command: a free swing, an offset, a drift."""
    t = one.time_s
    decay = np.exp(-sigma * t)
    return np.stack(
        [decay * np.cos(omega * t), decay * np.sin(omega * t), np.ones_like(t), t], axis=1
    )


def bases_of(data: Sequence[Driven], omega: float, sigma: float) -> list[tuple[Array, Array]]:
    """Of each stretch: an orthonormal basis of the free columns, and the data without them."""
    bases = []
    for one in data:
        q, _ = np.linalg.qr(free_columns(one, omega, sigma))
        bases.append((q, one.value - q @ (q.T @ one.value)))
    return bases


def responses(
    data: Sequence[Driven], omega: float, sigma: float, delay: float, lag: float
) -> list[tuple[Array, Array]]:
    """Of each stretch: swing by its commands at a full speed of 1 m/s, and the commanded speed."""
    filters = {
        kind: swing_filter(omega, sigma, max(lag, SHORTEST_LAG_S), kind)
        for kind in {one.kind for one in data}
    }
    return [_response(one, filters[one.kind], delay) for one in data]


def _response(one: Driven, coefficients: tuple[Array, Array], delay: float) -> tuple[Array, Array]:
    grid = np.arange(0.0, float(one.time_s[-1]) + 1.0 + 2.0 * BIN_S, BIN_S)
    at = np.searchsorted(one.command.time_s, one.start_s - 1.0 + grid - delay, side="right") - 1
    speed = np.where(at >= 0, one.command.speed[np.maximum(at, 0)], 0.0)
    # From rest at the first command's level; a swing before it is a free one.
    swing = lfilter(*coefficients, speed - speed[0])
    time = one.time_s + 1.0
    return np.interp(time, grid, swing), np.interp(time, grid, speed)


def swing_filter(
    omega: float, sigma: float, lag: float, kind: Kind, step_s: float = BIN_S
) -> tuple[Array, Array]:
    """Swing by the speed that is commanded, sampled with a zero-order hold: b and a of z^-1.

    By partial fractions of the step response, as a matrix exponential for every try of the solver
    takes most of its time. The three poles differ: one is real, two are not.
    """
    square = omega**2 + sigma**2
    poles = np.array([-1.0 / lag, complex(-sigma, omega), complex(-sigma, -omega)])
    apart = np.array([np.prod(pole - np.delete(poles, i)) for i, pole in enumerate(poles)])
    residues = square / (GRAVITY_M_S2 * lag * apart)
    if kind is Kind.RATE:
        residues = residues * poles
    decays = np.exp(poles * step_s)
    parts = [residue * np.poly(np.delete(decays, i)) for i, residue in enumerate(residues)]
    b = np.convolve([1.0, -1.0], np.sum(parts, axis=0)).real
    return b, np.asarray(np.poly(decays).real, dtype=np.float64)
