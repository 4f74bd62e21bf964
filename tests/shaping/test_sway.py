import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from canshaper.shaping.sway import GRAVITY_M_S2, SwayMode, SwayModel

TICKS_S = (0.001, 0.005, 0.01, 0.02, 0.05)
DAMPINGS = (0.0, 0.02, 0.1, 0.3)


def continuous(mode: SwayMode) -> tuple[np.ndarray, np.ndarray]:
    """The model's state equations: angle' = rate + v, rate' = -2 zeta w angle' - w^2 angle."""
    w, z = mode.omega_rad_s, mode.damping_ratio
    return np.array([[0.0, 1.0], [-w * w, -2 * z * w]]), np.array([[1.0], [-2 * z * w]])


def probed(mode: SwayMode, tick_s: float) -> tuple[np.ndarray, np.ndarray]:
    """State and input matrix of one step, from the running code."""
    columns = []
    for angle, rate, velocity in np.eye(3):
        model = SwayModel(mode, tick_s)
        model.angle, model.rate = angle, rate
        model.step(velocity)
        columns.append((model.angle, model.rate))
    matrix = np.array(columns).T
    return matrix[:, :2], matrix[:, 2:]


# -- where a mode comes from -----------------------------------------------------------------------


def test_a_grapple_swings_as_its_differential_equation_says() -> None:
    length, damping, mass = 1.2, 120.0, 300.0
    mode = SwayMode.from_grapple(length, damping, mass)
    # theta'' + c/(m l^2) theta' + g/l theta = 0
    expected = np.roots([1.0, damping / (mass * length**2), GRAVITY_M_S2 / length])
    assert mode.pole == pytest.approx(expected[np.argmax(expected.imag)], rel=1e-12)


def test_the_stopwatch_shows_the_damped_period() -> None:
    mode = SwayMode.from_period(2.2, 0.3)
    assert mode.period_s == pytest.approx(2.2, rel=1e-14)
    assert mode.damping_ratio == 0.3
    assert mode.omega_rad_s > 2.0 * math.pi / 2.2


@given(st.floats(0.5, 10.0), st.floats(0.0, 0.7))
def test_grapple_period_and_decay_describe_the_same_mode(period_s: float, decay: float) -> None:
    by_decay = SwayMode.from_decay(period_s, decay)
    by_period = SwayMode.from_period(period_s, by_decay.damping_ratio)
    length = GRAVITY_M_S2 / by_decay.omega_rad_s**2
    mass = 250.0
    by_grapple = SwayMode.from_grapple(length, -2.0 * by_decay.pole.real * mass * length**2, mass)
    assert by_decay.pole == pytest.approx(by_period.pole, rel=1e-12)
    assert by_decay.pole == pytest.approx(by_grapple.pole, rel=1e-9)
    # what the free swing of the model itself loses over one period
    ticks = 200
    model = SwayModel(by_decay, period_s / ticks)
    model.angle = 1.0
    for _ in range(ticks):
        model.step(0.0)
    assert model.angle == pytest.approx(1.0 - decay, abs=1e-9)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (
            lambda: SwayMode(0.24, 0.0),
            r"natural frequency: expected 0\.25 to 50 rad/s, got 0\.24 rad/s",
        ),
        (lambda: SwayMode(50.1, 0.0), r"natural frequency: expected .*, got 50\.1"),
        (lambda: SwayMode(math.nan, 0.0), r"natural frequency: expected .*, got nan"),
        (lambda: SwayMode(3.0, -0.01), r"damping ratio: expected 0 to 0\.95, got -0\.01"),
        (lambda: SwayMode(3.0, 1.0), r"damping ratio: expected .*, got 1"),
        (lambda: SwayMode(3.0, math.inf), r"damping ratio: expected .*, got inf"),
        (
            lambda: SwayMode.from_grapple(0.0, 0.0, 300.0),
            r"pendulum length: expected 0\.05 to 150 m, got 0 m",
        ),
        (
            lambda: SwayMode.from_grapple(-1.0, 0.0, 300.0),
            r"pendulum length: expected .*, got -1 m",
        ),
        (
            lambda: SwayMode.from_grapple(1.0, -1.0, 300.0),
            r"joint damping: expected .*, got -1 N m s/rad",
        ),
        (lambda: SwayMode.from_grapple(1.0, 0.0, 0.0), r"mass: expected .*, got 0 kg"),
        (
            lambda: SwayMode.from_grapple(1.0, math.nan, 300.0),
            r"joint damping: expected .*, got nan",
        ),
        (lambda: SwayMode.from_grapple(1.0, 1e6, 1.0), r"damping ratio: expected .*, got "),
        (lambda: SwayMode.from_period(0.0, 0.0), r"period: expected .*, got 0 s"),
        (lambda: SwayMode.from_period(26.0, 0.0), "period: expected 0.15 to 25 s, got 26 s"),
        (
            lambda: SwayMode.from_grapple(150.5, 0.0, 300.0),
            r"length: expected 0\.05 to 150 m, got 150\.5 m$",
        ),
        (
            lambda: SwayMode.from_grapple(30.0, 1000000.5, 1e5),
            r"expected 0 to 1e\+06 N m s/rad, got 1e\+06 N m s/rad$",
        ),
        (lambda: SwayMode.from_grapple(1.0, 0.0, 100000.5), r"mass: expected 1 to 100000 kg, got "),
        (
            lambda: SwayMode.from_period(2.0, 0.96),
            r"^damping ratio: expected 0 to 0\.95, got 0\.96$",
        ),
        (
            lambda: SwayMode.from_decay(2.0, 0.995),
            r"^decay per swing: expected 0 to 0\.99, got 0\.995$",
        ),
        (lambda: SwayMode.from_period(2.0, 1.0), r"damping ratio: expected .*, got 1"),
        (lambda: SwayMode.from_period(0.15, 0.95), r"natural frequency: expected .*, got "),
        (lambda: SwayMode.from_decay(2.0, 1.0), r"decay per swing: expected .*, got 1"),
        (lambda: SwayMode.from_decay(2.0, -0.1), r"decay per swing: expected .*, got -0\.1"),
        (lambda: SwayModel(SwayMode(3.0, 0.0), 0.0), r"tick: expected .*, got 0 s"),
        (lambda: SwayModel(SwayMode(3.0, 0.0), 0.3), r"tick: expected .*, got 0\.3 s"),
        (lambda: SwayModel(SwayMode(3.0, 0.0), math.nan), r"tick: expected .*, got nan"),
        (
            lambda: SwayModel(SwayMode(31.4, 0.0), 0.1),
            r"at a tick of 0\.1 s: expected 0 to 10 rad/s, got 31\.4 rad/s",
        ),
    ],
)
def test_nonsense_is_refused_by_name_and_range(make: object, says: str) -> None:
    assert callable(make)
    with pytest.raises(ValueError, match=says):
        make()


def test_the_ends_of_every_range_are_allowed() -> None:
    for mode in (
        SwayMode(0.5, 0.0),
        SwayMode(50.0, 0.95),
        SwayMode.from_grapple(0.05, 0.0, 1.0),
        SwayMode.from_grapple(30.0, 1e6, 1e5),
        SwayMode.from_period(12.0, 0.0),
        SwayMode.from_period(0.15, 0.0),
        SwayMode.from_period(12.0, 0.95),
        SwayMode.from_decay(12.0, 0.0),
        SwayMode.from_decay(12.0, 0.99),
    ):
        assert 0.5 <= mode.omega_rad_s <= 50.0
    for tick_s, omega in ((1e-4, 50.0), (0.2, 5.0), (0.125, 8.0)):
        assert SwayModel(SwayMode(omega, 0.0), tick_s).tick_s == tick_s


# -- the sampled model -----------------------------------------------------------------------------


@pytest.mark.parametrize("tick_s", TICKS_S)
@pytest.mark.parametrize("damping", DAMPINGS)
@pytest.mark.parametrize("omega", [1.5, 2.9, 6.0])
def test_one_step_is_the_exact_hold_of_the_pendulum(
    omega: float, damping: float, tick_s: float
) -> None:
    mode = SwayMode(omega, damping)
    a, b = continuous(mode)
    ad, bd, *_ = signal.cont2discrete((a, b, np.eye(2), np.zeros((2, 1))), tick_s, "zoh")
    got_a, got_b = probed(mode, tick_s)
    assert got_a == pytest.approx(ad, abs=2e-15, rel=1e-13)
    assert got_b == pytest.approx(bd, abs=2e-15, rel=1e-13)


@pytest.mark.parametrize("damping", DAMPINGS)
def test_the_shown_angle_is_that_of_the_pendulum_in_rad(damping: float) -> None:
    mode, tick_s, full_speed = SwayMode(2.86, damping), 0.02, 1.5
    velocity = np.random.default_rng(7).uniform(-1.0, 1.0, 500)
    # theta / v = (w^2 / g) s / (s^2 + 2 zeta w s + w^2), held commands
    w = mode.omega_rad_s
    system = ([w * w / GRAVITY_M_S2, 0.0], [1.0, 2.0 * damping * w, w * w])
    times = np.arange(velocity.size + 1) * tick_s
    _, theta, _ = signal.lsim(system, np.append(velocity, 0.0) * full_speed, times, interp=False)
    model = SwayModel(mode, tick_s)
    shown = []
    for v in velocity:
        model.step(float(v))
        shown.append(model.sway_rad(full_speed))
    assert shown == pytest.approx(theta[1:], abs=1e-12)


@pytest.mark.parametrize("tick_s", TICKS_S)
@given(velocity=st.floats(-1.0, 1.0), damping=st.floats(0.0, 0.95))
def test_the_equilibrium_at_constant_speed_is_kept_exactly(
    tick_s: float, velocity: float, damping: float
) -> None:
    model = SwayModel(SwayMode(2.9, damping), tick_s)
    model.rate = -velocity
    for _ in range(100):
        model.step(velocity)
    assert (model.angle, model.rate) == (0.0, -velocity)


@given(
    st.floats(-1.0, 1.0),
    st.floats(-2.0, 2.0),
    st.floats(-1.0, 1.0),
    st.tuples(st.floats(0.5, 10.0), st.floats(0.0, 0.9)),
)
def test_retuning_keeps_the_physical_swing(
    angle: float, rate: float, velocity: float, new: tuple[float, float]
) -> None:
    old = SwayModel(SwayMode(2.9, 0.05), 0.02)
    old.angle, old.rate = angle, rate
    model = old.retuned(SwayMode(*new), velocity)
    assert model.mode == SwayMode(*new)
    assert model.tick_s == old.tick_s
    assert model.sway_rad(1.5) == pytest.approx(old.sway_rad(1.5), abs=1e-12)

    def rate_rad_s(m: SwayModel) -> float:
        return (m.rate + velocity) * m.mode.angle_per_speed_rad

    assert rate_rad_s(model) == pytest.approx(rate_rad_s(old), abs=1e-12)
    assert (old.angle, old.rate) == (angle, rate)


def test_retuning_keeps_what_a_sensor_shows_besides() -> None:
    old = SwayModel(SwayMode(3.0, 0.05), 0.02)
    old.free_angle, old.free_rate = 0.4, -0.6
    model = old.retuned(SwayMode(1.5, 0.1), 0.0)
    # At the same speed it swings a quarter as far: the same angle is four times as much.
    assert (model.free_angle, model.free_rate) == pytest.approx((1.6, -2.4), rel=1e-14)
