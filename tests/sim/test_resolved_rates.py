"""Joint rates within bounds: exact, in the asked direction, the fastest there is, damped."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog

from canshaper_sim.joints import JointParameters
from canshaper_sim.kinematics import Jacobian
from canshaper_sim.resolved_rates import Bounds, ResolvedRates, Vector, less

FULL = (0.4, 0.7, 1.0)
BOOM = JointParameters().boom
poses = st.tuples(st.floats(-0.3, 1.3), st.floats(-2.5, 0.0), st.floats(0.0, 3.0))
velocities = st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
reach = st.sampled_from([0.0, 0.01, 0.3, 1.0])
bounds = st.builds(
    lambda low, high: Bounds((-low[0], -low[1], -low[2]), high),
    st.tuples(reach, reach, reach),
    st.tuples(reach, reach, reach),
)


def tip_velocity(jacobian: Jacobian, rates: Vector) -> tuple[float, float]:
    a = np.array(jacobian).reshape(2, 3) @ np.diag(FULL) @ np.array(rates)
    return float(a[0]), float(a[1])


@given(pose=poses, velocity=velocities)
def test_least_squares_gives_the_velocity_with_the_smallest_rates(
    pose: Vector, velocity: tuple[float, float]
) -> None:
    jacobian = BOOM.jacobian(*pose)
    solver = ResolvedRates(jacobian, FULL, 0.2)
    rates = solver.least_squares(*velocity)
    assert tip_velocity(jacobian, rates) == pytest.approx(velocity, abs=1e-9)
    a = np.array(jacobian).reshape(2, 3) @ np.diag(FULL)
    assert rates == pytest.approx(tuple(np.linalg.pinv(a) @ velocity), abs=1e-9)
    assert tip_velocity(jacobian, solver.free) == pytest.approx((0.0, 0.0), abs=1e-9)


@given(pose=poses, velocity=velocities, limits=bounds, target=st.floats(-0.5, 0.5))
def test_bounds_are_kept_with_the_fastest_motion_in_the_asked_direction(
    pose: Vector, velocity: tuple[float, float], limits: Bounds, target: float
) -> None:
    assume(max(map(abs, velocity)) > 1e-3)
    jacobian = BOOM.jacobian(*pose)
    solver = ResolvedRates(jacobian, FULL, 0.2)
    p = solver.least_squares(*velocity)
    scale, rates = solver.within(p, limits, target)
    for low, rate, high in zip(limits.low, rates, limits.high, strict=True):
        assert low <= rate <= high
    assert tip_velocity(jacobian, rates) == pytest.approx(
        (scale * velocity[0], scale * velocity[1]), abs=1e-5
    )
    rows = np.column_stack([p, solver.free])
    best = linprog(
        [-1.0, 0.0],
        A_ub=np.vstack([rows, -rows]),
        b_ub=[*(v + 1e-6 for v in limits.high), *(1e-6 - v for v in limits.low)],
        bounds=[(0.0, 1.0), (None, None)],
    )
    assert scale == pytest.approx(best.x[0], abs=1e-5)


def test_rounding_next_to_a_blocked_joint_does_not_stop_the_tip() -> None:
    """A straight arm pointing level, only the knuckle free: it alone can lift the tip."""
    jacobian = BOOM.jacobian(1.3e-28, 0.0, 0.0)
    solver = ResolvedRates(jacobian, FULL, 0.2)
    only_knuckle = Bounds((0.0, 0.0, 0.0), (0.0, 0.01, 0.0))
    scale, rates = solver.within(solver.least_squares(0.0, 1.0), only_knuckle)
    assert rates == pytest.approx((0.0, 0.01, 0.0), abs=1e-5)
    assert scale == pytest.approx(0.0161, abs=1e-4)


def test_the_command_is_met_where_the_bounds_leave_a_choice() -> None:
    solver = ResolvedRates(BOOM.jacobian(0.8, -1.2, 1.0), FULL, 0.2)
    p = solver.least_squares(0.3, 0.0)
    scale, rates = solver.within(p, Bounds((-1.0,) * 3, (1.0,) * 3), 0.1)
    assert scale == 1.0
    expected = [a + 0.1 * n for a, n in zip(p, solver.free, strict=True)]
    assert rates == pytest.approx(expected, abs=1e-12)


def test_damping_bounds_the_rates_where_the_jacobian_is_singular() -> None:
    """Straight arm, telescope as slow as none: the tip cannot be moved along the arm."""
    jacobian = BOOM.jacobian(0.5, -1e-9, 0.0)
    slow = (0.4, 0.7, 1e-9)
    along = (np.cos(0.5), np.sin(0.5))
    assert max(map(abs, ResolvedRates(jacobian, slow, 0.0).least_squares(*along))) > 1e3
    damped = ResolvedRates(jacobian, slow, 0.2).least_squares(*along)
    assert max(map(abs, damped)) < 1e-3
    across = ResolvedRates(jacobian, slow, 0.2).least_squares(-along[1], along[0])
    a = np.array(jacobian).reshape(2, 3) @ np.diag(slow)
    assert a @ across == pytest.approx((-along[1], along[0]), rel=0.02)


def test_bounds_less_what_is_used() -> None:
    left = less(Bounds((-1.0, -0.2, 0.0), (1.0, 0.5, 0.3)), (0.4, -0.2, 0.3))
    assert left.low == pytest.approx((-1.4, 0.0, -0.3))
    assert left.high == pytest.approx((0.6, 0.7, 0.0))
