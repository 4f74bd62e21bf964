"""The model of a driven swing against SciPy's, and a long log against its parts."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import cont2discrete, lfilter

from canshaper.commissioning.identification import driven
from canshaper.commissioning.identification.driven import swing_filter
from canshaper.commissioning.identification.series import BIN_S, Kind
from canshaper.shaping.sway import GRAVITY_M_S2
from canshaper_sim.grapple import Grapple
from tests.commissioning.identification.coverage import BOTH, cases
from tests.commissioning.identification.driven import drive
from tests.commissioning.identification.machine import Push


@pytest.mark.slow
@given(
    omega=st.floats(0.5, 20.0),
    ratio=st.floats(0.0, 0.6),
    lag=st.floats(0.005, 0.6),
    kind=st.sampled_from([Kind.ANGLE, Kind.RATE]),
)
def test_the_sampled_model_is_that_of_scipy(
    omega: float, ratio: float, lag: float, kind: Kind
) -> None:
    sigma = ratio * omega
    square = omega**2 + sigma**2
    zeros = [square / GRAVITY_M_S2, 0.0] + [0.0] * (kind is Kind.RATE)
    poles = np.polymul([lag, 1.0], [1.0, 2.0 * sigma, square])
    b, a, _ = cont2discrete((zeros, poles), BIN_S, method="zoh")
    speed = np.sign(np.sin(np.arange(400) ** 1.3))
    theirs = lfilter(b.ravel(), a, speed)
    ours = lfilter(*swing_filter(omega, sigma, lag, kind), speed)
    assert ours == pytest.approx(theirs, abs=1e-6 * np.abs(theirs).max())


@pytest.mark.slow
def test_a_part_of_the_stretches_first_finds_what_all_of_them_do(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    strokes = [Push("near_far", 2.0 + 9.0 * k, 0.7, 0.3 * (-1) ** k) for k in range(12)]
    series = [drive(strokes, 112.0, Kind.ANGLE, 3)]
    fits = []
    for first in (100, 3):
        monkeypatch.setattr(driven, "FIRST_STRETCHES", first)
        fits.append(driven.fit_driven(series, [1.6, 2.2, 3.0], None))
    every, fewer = fits
    assert every and fewer and every.period_s and fewer.period_s
    assert len(fewer.stretches) == len(every.stretches) > 4
    assert fewer.explained == pytest.approx(every.explained, abs=0.01)
    assert fewer.period_s.value == pytest.approx(every.period_s.value, rel=1e-3)
    assert fewer.period_s.half == pytest.approx(every.period_s.half, rel=0.1)


@pytest.mark.slow
def test_driven_motion_of_two_directions_reports_no_damping_that_it_cannot_know() -> None:
    """A heavy tool that is hardly damped takes swing from the other direction and gives it back."""
    heavy = Grapple(l2_m=2.2, m2_kg=900.0, c5_n_m_s_rad=125.0, c6_n_m_s_rad=125.0)
    _, case = cases(heavy, BOTH, 0.15, 0.1, seed=2)
    ratio = case.finding.damping_ratio
    assert ratio
    assert abs(ratio.value - case.mode.zeta) < ratio.half
    assert any("no decay is seen" in why for why in case.finding.problems)
