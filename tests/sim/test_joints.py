"""The boom joint by joint: motion of the tip, accelerations, end stops, refusals."""

import math
from dataclasses import replace
from typing import Any

import pytest
from scipy.integrate import solve_ivp

from canshaper_sim import crane as crane_module
from canshaper_sim.axes import JOINT_AXES
from canshaper_sim.crane import Crane, CraneParameters, joint_crane
from canshaper_sim.grapple import Sway, TipMotion, accelerations
from canshaper_sim.joints import JointBoom, JointParameters
from tests.sim.drives import LINEAR, REAL, TICK_S

RAD = math.pi / 180.0


def crane_with(valve: Any = None, sway: Sway | None = None, **joints: Any) -> Crane:
    """A joint crane; `valve` goes into every joint."""
    if valve is None:
        return joint_crane(CraneParameters(joints=JointParameters(**joints)), sway)
    boom = JointParameters(lift_cylinder=valve, knuckle=valve, extension=valve, **joints)
    return joint_crane(CraneParameters(slew=valve, joints=boom), sway)


def boom_of(crane: Crane) -> JointBoom:
    assert isinstance(crane.boom, JointBoom)
    return crane.boom


def mixed(k: int) -> dict[str, float]:
    """Steps of all joints, which stay clear of their stops."""
    return {
        "slew": (0.0, 0.8, 0.8, -0.6, 0.0)[k // 40 % 5],
        "lift_cylinder": (-0.8, -0.8, 0.9, 0.3)[(k + 13) // 40 % 4],
        "knuckle": (0.0, 0.7, -0.9, 0.4)[(k + 27) // 40 % 4],
        "extension": (0.8, -0.5, 0.6, -0.7)[(k + 6) // 40 % 4],
    }


def test_both_cranes_start_with_the_tip_at_the_same_place() -> None:
    assert joint_crane().state == pytest.approx(tuple(Crane().state), abs=1e-12)
    slew, lift, knuckle, extension = boom_of(joint_crane()).joints
    assert (slew, extension) == (0.0, 0.1)
    assert -20 * RAD < lift < 80 * RAD
    assert -150 * RAD < knuckle < 0.0


@pytest.mark.parametrize("axis", JOINT_AXES)
def test_a_positive_command_moves_its_joint_up_or_out_at_full_speed(axis: str) -> None:
    crane = crane_with(LINEAR, start_extension_m=0.2)
    before = boom_of(crane).joints
    sign = -1.0 if axis == "lift_cylinder" else 1.0  # the main boom starts high up
    for _ in range(60):
        crane.step(TICK_S, {axis: sign})
    after = boom_of(crane).joints
    full = {"slew": 0.5, "lift_cylinder": 0.4, "knuckle": 0.7, "extension": 1.0}[axis]
    for name, a, b in zip(JOINT_AXES, before, after, strict=True):
        travel = 0.0 if name != axis else sign * full * (1.2 - 0.1)  # the lag is 0.1 s
        assert b - a == pytest.approx(travel, abs=1e-4)


def test_tip_follows_the_joints() -> None:
    """Pose is the kinematics of the joints; speed the change of the pose."""
    crane = crane_with(REAL, start_extension_m=0.4)
    boom = crane.parameters.joints.boom
    for k in range(300):
        before = crane.state
        crane.step(TICK_S, mixed(k))
        middle = crane.state
        assert (middle.radius_m, middle.height_m) == boom.tip(*boom_of(crane).joints[1:])
        assert middle.theta1_rad == boom_of(crane).joints[0]
        crane.step(1e-5, {})
        for i in (1, 2, 3):
            assert (crane.state[i] - middle[i]) / 1e-5 == pytest.approx(middle[i + 3], abs=1e-3)
        assert before.time_s < middle.time_s


@pytest.mark.slow
def test_tip_accelerations_are_the_change_of_the_tip_speed() -> None:
    """J q'' + J' q' at the end of a step; start and middle against a run in much finer steps."""
    p = CraneParameters(joints=JointParameters(LINEAR, LINEAR, LINEAR, start_extension_m=0.4))
    start = (0.0, p.start_radius_m, p.start_height_m)
    coarse, fine = (JointBoom(p.joints, LINEAR, 0.5, start) for _ in range(2))
    h, parts = 0.01, 100
    largest = 0.0
    for k in range(400):
        for boom in (coarse, fine):
            for axis, command in mixed(k // 2).items():
                boom.axes[axis].valve.set_command(command)
        tips = coarse.advance(h)
        rows = [fine.advance(h / parts) for _ in range(parts)]
        for stage, row in zip(tips, (rows[0][0], rows[parts // 2][0], rows[-1][2]), strict=True):
            assert stage == pytest.approx(tuple(row), abs=5e-3)
            largest = max(largest, abs(row.radius_acceleration_m_s2))
        # The fine run's speed, differentiated: the end acceleration is that of the motion.
        for index, rate in ((2, 1), (4, 3)):
            slope = (rows[-1][2][rate] - rows[-2][2][rate]) / (h / parts)
            assert tips[2][index] == pytest.approx(slope, abs=2e-2)
        # Change of speed and way of the step, as the Runge-Kutta step sees them.
        a, b, c = (tip.radius_acceleration_m_s2 for tip in tips)
        change = tips[2].radius_rate_m_s - tips[0].radius_rate_m_s
        way = tips[2].radius_m - tips[0].radius_m - h * tips[0].radius_rate_m_s
        assert h / 6 * (a + 4 * b + c) == pytest.approx(change, abs=1e-12)
        assert h * h / 6 * (a + 2 * b) == pytest.approx(way, abs=1e-12)
    assert largest > 10.0


def test_agrees_with_a_general_ode_solver() -> None:
    """DOP853 over joints and sway together, broken where a command changes."""
    crane = crane_with(LINEAR, Sway(0.1, -0.2, 0.3, 0.1), start_extension_m=0.4)
    p = crane.parameters
    boom = p.joints.boom
    full = (0.5, 0.4, 0.7, 1.0)
    commands = [0.0] * 4

    def rhs(_t: float, y: Any) -> list[float]:
        rates = [f * v for f, v in zip(full, y[:4], strict=True)]
        slopes = [(u - v) / 0.1 for u, v in zip(commands, y[:4], strict=True)]
        acc = [f * s for f, s in zip(full, slopes, strict=True)]
        q = tuple(y[5:8])
        j = boom.jacobian(*q)
        drift = boom.drift(q, tuple(rates[1:]))
        radius_rate = sum(a * b for a, b in zip(j[:3], rates[1:], strict=True))
        radius_acc = sum(a * b for a, b in zip(j[:3], acc[1:], strict=True)) + drift[0]
        height_acc = sum(a * b for a, b in zip(j[3:], acc[1:], strict=True)) + drift[1]
        tip = TipMotion(boom.tip(*q)[0], radius_rate, radius_acc, rates[0], acc[0], height_acc)
        return [*slopes, *rates, y[10], y[11], *accelerations(p.grapple, tuple(y[8:12]), tip)]

    y: list[float] = [0.0] * 4 + [*boom_of(crane).joints, 0.1, -0.2, 0.3, 0.1]
    worst = 0.0
    for k in range(300):
        values = mixed(k)
        commands[:] = [values[axis] for axis in JOINT_AXES]
        crane.step(TICK_S, values)
        solved = solve_ivp(rhs, (0.0, TICK_S), y, method="DOP853", rtol=1e-11, atol=1e-12)
        y = [float(v) for v in solved.y[:, -1]]
        assert boom_of(crane).joints == pytest.approx(y[4:8], abs=1e-6)
        worst = max(worst, *(abs(a - b) for a, b in zip(crane.state[7:11], y[8:12], strict=True)))
    assert crane.axes_at_stop == ()
    assert worst < 3e-5  # rad and rad/s


@pytest.mark.parametrize(
    ("axis", "command", "limit"),
    [
        ("slew", 1.0, 190 * RAD),
        ("slew", -1.0, -190 * RAD),
        ("lift_cylinder", 1.0, 80 * RAD),
        ("lift_cylinder", -1.0, -20 * RAD),
        ("knuckle", 1.0, 0.0),
        ("knuckle", -1.0, -150 * RAD),
        ("extension", 1.0, 3.0),
        ("extension", -1.0, 0.0),
    ],
)
def test_end_stops_hold_a_joint_and_let_it_go(axis: str, command: float, limit: float) -> None:
    crane = joint_crane()
    index = JOINT_AXES.index(axis)
    for _ in range(500):
        crane.step(TICK_S, {axis: command})
    assert boom_of(crane).joints[index] == limit
    assert boom_of(crane).joint_rates == (0.0,) * 4
    assert crane.axes_at_stop == (axis,)
    assert crane.state[4:7] == (0.0, 0.0, 0.0)
    for _ in range(60):
        crane.step(TICK_S, {axis: -command})
    assert crane.axes_at_stop == ()
    assert (boom_of(crane).joints[index] - limit) * command < -0.3


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["lift_cylinder", "knuckle", "extension"])
def test_internal_step_has_converged_at_end_stops(
    monkeypatch: pytest.MonkeyPatch, axis: str
) -> None:
    """Where a joint meets its stop within a step, 10 ms and 0.2 ms still agree."""

    def run(start_m: float) -> list[float]:
        crane = crane_with(start_extension_m=start_m)
        swing = []
        for k in range(250):
            crane.step(TICK_S, {axis: 1.0 if k < 190 else -0.6})
            swing.append(crane.state.theta6_rad)
        return swing

    for start_m in (0.1, 0.1071):
        coarse = run(start_m)
        with monkeypatch.context() as patch:
            patch.setattr(crane_module, "INTERNAL_STEP_S", 2e-4)
            fine = run(start_m)
        assert coarse == pytest.approx(fine, abs=4e-3)  # 0.2 deg of some 20


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"main_boom_m": 0.0}, r"joints: main_boom_m: expected 0.5 .. 20.0, got 0.0"),
        ({"lift_max_deg": -30.0}, r"joints: lift_max_deg: expected more than -20.0, got -30.0"),
        ({"start_extension_m": 3.5}, r"joints: start_extension_m: expected 0.0 .. 3.0, got 3.5"),
        (
            {"knuckle_full_speed_rad_s": math.nan},
            "joints: knuckle_full_speed_rad_s: expected 0.01 .. 3.0, got nan",
        ),
    ],
)
def test_impossible_booms_are_refused(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replace(JointParameters(), **changes)


def test_a_start_pose_beyond_the_joints_is_refused() -> None:
    with pytest.raises(
        ValueError,
        match=r"lift_cylinder in the start pose: expected -20.0 deg .. 80.0 deg, got .* deg",
    ):
        joint_crane(CraneParameters(start_height_m=5.5))
    with pytest.raises(ValueError, match="out of reach"):
        joint_crane(CraneParameters(start_radius_m=8.0, start_height_m=6.0))
    with pytest.raises(ValueError, match=r"slew in the start pose: expected .*, got 200.* deg"):
        joint_crane(CraneParameters(start_theta1_rad=3.5))
