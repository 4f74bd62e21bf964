"""G_FF as a linear filter, judged on the running code: one step is probed as a linear map."""

import itertools
import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from canshaper.shaping.shapers.gff import Gff, denominator_from_poles, poles_from_denominator
from canshaper.shaping.sway import SwayMode, SwayModel

TICKS_S = (0.001, 0.005, 0.01, 0.02, 0.05)
DAMPINGS = (0.0, 0.02, 0.1, 0.3)
OMEGAS = (1.5, 2.86, 5.0)
SLEW = poles_from_denominator(0.42, 0.043)
POLES = {"slew": SLEW, "apart": (-8.0, -1.0), "double": (-2.86, -2.86), "fast double": (-6.0, -6.0)}

Matrix = list[list[Fraction]]


def step(gff: Gff, sway: SwayModel, command: float) -> float:
    """One tick without any limit: the output is what is sent."""
    sent = gff.step(command)
    sway.step(sent)
    return sent


def probed(mode: SwayMode, tick_s: float, poles: tuple[float, float]) -> tuple[Matrix, Matrix]:
    """Increments of the state and the output for unit state and input: ([A-I | B], [C | D]).

    Differences and everything after them are exact (Fraction), so that only the rounding of the
    code under test is seen.
    """
    columns = []
    for angle, rate, command in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        sway = SwayModel(mode, tick_s)
        gff = Gff(sway, poles)
        sway.angle, sway.rate = angle, rate
        sent = step(gff, sway, command)
        columns.append(
            (Fraction(sway.angle) - Fraction(angle), Fraction(sway.rate) - Fraction(rate), sent)
        )
    rows = [[Fraction(c[i]) for c in columns] for i in range(3)]
    return rows[:2], rows[2:]


def trace_and_determinant(m: Matrix) -> tuple[Fraction, Fraction]:
    return m[0][0] + m[1][1], m[0][0] * m[1][1] - m[0][1] * m[1][0]


def eigenvalues(m: Matrix) -> list[np.clongdouble]:
    """Both eigenvalues, the upper or larger one first."""
    trace, determinant = trace_and_determinant(m)
    quarter = trace * trace / 4 - determinant  # exact, so no cancellation here
    root = np.sqrt(np.clongdouble(_long(quarter)))
    half = _long(trace) / 2
    return [half + root, half - root]


def _long(x: Fraction) -> np.longdouble:
    """Fraction to long double, correct to 1e-19 (float() first would spoil it)."""
    high = float(x)
    return np.longdouble(high) + np.longdouble(float(x - Fraction(high)))


def zero_dynamics(state: Matrix, output: Matrix) -> Matrix:
    """A - I - B C / D: what moves while the output stays zero; its eigenvalues are the zeros."""
    (c1, c2, d), (b1, b2) = output[0], (state[0][2], state[1][2])
    return [
        [state[0][0] - b1 * c1 / d, state[0][1] - b1 * c2 / d],
        [state[1][0] - b2 * c1 / d, state[1][1] - b2 * c2 / d],
    ]


@pytest.mark.parametrize("poles", POLES.values(), ids=POLES.keys())
@pytest.mark.parametrize("omega", OMEGAS)
@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("tick_s", TICKS_S)
def test_zeros_poles_and_gain(
    tick_s: float, damping: float, omega: float, poles: tuple[float, float]
) -> None:
    mode = SwayMode(omega, damping)
    state, output = probed(mode, tick_s, poles)

    zeros = eigenvalues(zero_dynamics(state, output))
    w, z, t = (np.longdouble(x) for x in (omega, damping, tick_s))
    swing = np.exp(w * t * (-z + 1j * np.sqrt(1 - z * z)))
    assert abs(1 + zeros[0] - swing) < 1e-12
    assert abs(1 + zeros[1] - np.conj(swing)) < 1e-12

    # In d = z - 1, where poles near 1 keep their digits. Both coefficients are well conditioned
    # also for a double pole, whose eigenvalues are not: an error e of a coefficient moves them by
    # sqrt(e), 1e-8 for one rounding, whatever the code does.
    trace, determinant = trace_and_determinant(state)
    d1, d2 = (np.expm1(np.longdouble(p) * t) for p in poles)
    assert abs(_long(trace) - (d1 + d2)) < 2e-15
    assert abs(_long(determinant) - d1 * d2) < 2e-15
    if poles[0] != poles[1]:
        got = sorted(eigenvalues(state), key=lambda d: float(d.real))
        assert abs(1 + got[0] - (1 + min(d1, d2))) < 1e-12
        assert abs(1 + got[1] - (1 + max(d1, d2))) < 1e-12

    # D - C (A - I)^-1 B by Cramer's rule: the gain at z = 1
    (a, b, b1), (c, d, b2) = state
    (c1, c2, d0) = output[0]
    solved = ((d * b1 - b * b2) / determinant, (a * b2 - c * b1) / determinant)
    gain = d0 - c1 * solved[0] - c2 * solved[1]
    assert abs(gain - 1) < 1e-12


@pytest.mark.parametrize("poles", POLES.values(), ids=POLES.keys())
@pytest.mark.parametrize("damping", [0.0, 0.05])
@pytest.mark.parametrize(
    ("push_s", "order"),
    # A jump is met to first order in T (the feedthrough depends on the tick), a moving joystick to
    # second order (matched poles, zeros and gain leave no difference linear in T).
    [(0.0, 1), (0.5, 2)],
)
def test_small_ticks_approach_equation_13(
    push_s: float, order: int, damping: float, poles: tuple[float, float]
) -> None:
    omega = 2.86
    a1, a2 = denominator_from_poles(poles)
    system = ([1 / omega**2, 2 * damping / omega, 1.0], [a2, a1, 1.0])
    errors = []
    for tick_s in (0.01, 0.005, 0.0025, 0.00125):
        times = np.arange(round(3.0 / tick_s)) * tick_s
        command = np.minimum(times / push_s, 1.0) if push_s else np.ones_like(times)
        _, expected, _ = signal.lsim(system, command, times)
        sway = SwayModel(SwayMode(omega, damping), tick_s)
        gff = Gff(sway, poles)
        got = np.array([step(gff, sway, float(u)) for u in command])
        errors.append(float(np.max(np.abs(got - expected))))
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(2.0**order, rel=0.1)
    assert errors[-1] < 0.01 / (a2 * omega**2)


# -- the poles -------------------------------------------------------------------------------------


@given(st.floats(-100.0, -0.1), st.floats(-100.0, -0.1))
def test_poles_and_denominator_are_two_names_of_one_filter(p: float, q: float) -> None:
    a1, a2 = denominator_from_poles((p, q))
    if a1 * a1 < 4.0 * a2:  # a double pole, rounded to the complex side
        a2 = a1 * a1 / 4.0
    fast, slow = poles_from_denominator(a1, a2)
    assert fast <= slow * (1.0 - 1e-15) < 0.0
    # a double pole again: rounding moves its two halves by sqrt(eps)
    assert (fast, slow) == pytest.approx((min(p, q), max(p, q)), rel=1e-7)
    assert denominator_from_poles((fast, slow)) == pytest.approx((a1, a2), rel=1e-14)


def test_the_papers_denominators() -> None:
    # The printed poles belong to a1 = 0.42001, a2 = 0.043052 before rounding to two digits.
    assert poles_from_denominator(0.42001, 0.043052) == pytest.approx((-5.6307, -4.1253), abs=2e-4)
    sway = SwayModel(SwayMode(2.86, 0.05), 0.02)
    assert Gff.from_denominator(sway, 0.42, 0.043).poles_rad_s == SLEW


def test_poles_far_apart_keep_their_digits() -> None:
    a1, a2 = denominator_from_poles((-1e6, -0.5))
    assert poles_from_denominator(a1, a2) == pytest.approx((-1e6, -0.5), rel=1e-14)


@pytest.mark.parametrize(
    ("a1", "a2", "says"),
    [
        (
            0.4,
            0.043,
            r"^a1: expected 0\.414729 or more for a2 = 0\.043 \(real poles, a1\^2 >= 4 a2\), got"
            r" 0\.4$",
        ),
        (0.0, 0.043, r"^a1, a2: expected positive numbers, got 0, 0\.043$"),
        (-0.42, 0.043, r"expected positive numbers, got -0\.42, 0\.043$"),
        (0.42, 0.0, r"expected positive numbers, got 0\.42, 0$"),
        (0.42, -0.043, r"expected positive numbers, got 0\.42, -0\.043$"),
        (math.nan, 0.043, "got nan, 0"),
        (math.inf, 0.043, "got inf, 0"),
        (0.42, math.nan, r"got 0\.42, nan"),
        (0.42, math.inf, r"got 0\.42, inf"),
    ],
)
def test_a_denominator_without_real_negative_poles_is_refused(
    a1: float, a2: float, says: str
) -> None:
    with pytest.raises(ValueError, match=says):
        poles_from_denominator(a1, a2)


@pytest.mark.parametrize("bad", [0.0, 0.1, -50.1, -math.inf, math.inf, math.nan])
def test_a_pole_that_is_not_negative_or_too_fast_for_the_tick_is_refused(bad: float) -> None:
    sway = SwayModel(SwayMode(2.86, 0.05), 0.02)
    for poles in ((bad, -3.0), (-3.0, bad)):
        says = r"expected -50 to below 0 rad/s at a tick of 0\.02 s, got"
        with pytest.raises(ValueError, match=says):
            Gff(sway, poles)
    Gff(sway, (-50.0, -3.0))


def test_other_discretisations_bring_swing_back() -> None:
    """Eq. 13 at 20 ms by a zero-order hold and by Tustin, at the poles of the swing it is for."""
    left: dict[str, list[float]] = {"zoh": [], "bilinear": []}
    for mode in (SwayMode.from_grapple(1.2, 120.0, 300.0), SwayMode.from_period(2.356, 0.038)):
        w, zeta = mode.omega_rad_s, mode.damping_ratio
        at = np.exp(mode.pole * 0.02)
        for a1, a2 in ((0.42, 0.043), (0.708, 0.12)):
            for method, found in left.items():
                eq_13 = ([1.0 / w**2, 2.0 * zeta / w, 1.0], [a2, a1, 1.0])
                b, a, _ = signal.cont2discrete(eq_13, 0.02, method)
                found.append(float(100.0 * abs(np.polyval(b.ravel(), at) / np.polyval(a, at))))
    assert [round(f(left["zoh"]), 1) for f in (min, max)] == [3.0, 9.0]
    assert round(max(left["bilinear"]), 2) == 0.04
