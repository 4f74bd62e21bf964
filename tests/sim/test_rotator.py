"""A log in the rotator: long, or off its middle, it turns the swing between the two planes."""

import math

import pytest

from canshaper.machine.deployment import Deployment
from canshaper_sim.axes import ROTATOR
from canshaper_sim.crane import Crane, CraneState
from canshaper_sim.cranes import one_crane
from canshaper_sim.grapple import Sway
from canshaper_sim.machines import TIP_CONTROLLER
from canshaper_sim.parameters import changed_parameters
from canshaper_sim.plant import PlantNode
from tests.rigs.files import CONFIG, read
from tests.rigs.sent import command_frame
from tests.sim.drives import TICK_S
from tests.sim.test_log import period_s

POINTS = ("grapple.l1_m=0", "grapple.m1_kg=0", "grapple.c5_n_m_s_rad=0", "grapple.c6_n_m_s_rad=0")
# One body of 900 kg, 1.2 m below the tip; with 6 m a third slower along the log.
LOG = ("log.grip_s=0", "log.mass_kg=600", "log.below_m=0")
STILL = Sway()


def swung(
    *changes: str, sway: Sway = STILL, turn: float = 0.0, seconds: float = 10.0
) -> list[CraneState]:
    crane, states = Crane(changed_parameters([*POINTS, *LOG, *changes]), sway), []
    for _ in range(round(seconds / TICK_S)):
        crane.step(TICK_S, {ROTATOR: turn})
        states.append(crane.state)
    return states


def slow(length_m: float) -> float:
    """Period of a swing along a log, of that across it, by its moment of inertia."""
    return math.sqrt(1.0 + 600.0 * length_m**2 / 12.0 / (900.0 * 1.2**2))


@pytest.mark.parametrize("start_deg", [0.0, 90.0])
def test_along_and_across_the_log_each_plane_keeps_its_swing(start_deg: float) -> None:
    sway = Sway(theta5_rad=0.02, theta6_rad=0.03)
    states = swung("log.length_m=6", f"rotator.start_deg={start_deg}", sway=sway, seconds=30.0)
    across, along = ([s[i] for s in states] for i in (7, 8))
    ratio = period_s(along) / period_s(across)
    assert ratio == pytest.approx(slow(6.0) if start_deg == 0.0 else 1.0 / slow(6.0), rel=2e-3)


def test_at_an_angle_the_swing_moves_into_the_other_plane() -> None:
    """All of it, when both modes have come to be half a turn apart."""
    states = swung(
        "log.length_m=3", "rotator.start_deg=45", sway=Sway(theta6_rad=0.03), seconds=30.0
    )
    fast = math.sqrt(9.81 / 1.2)
    apart = round(math.pi / (fast - fast / slow(3.0)) / TICK_S)
    first, late = states[:50], states[apart - 50 : apart + 50]
    assert max(abs(s.theta5_rad) for s in first) < 0.01
    assert max(abs(s.theta5_rad) for s in late) == pytest.approx(0.03, rel=0.03)
    assert max(abs(s.theta6_rad) for s in late) < 0.01


@pytest.mark.parametrize("start_deg", [0.0, 30.0, 90.0])
def test_off_its_middle_it_hangs_askew(start_deg: float) -> None:
    """Its centre is below the tip; with much damping it comes to rest there."""
    damped = ("grapple.c5_n_m_s_rad=2000", "grapple.c6_n_m_s_rad=2000", "log.off_centre_m=0.3")
    state = swung(*damped, f"rotator.start_deg={start_deg}", seconds=30.0)[-1]
    n, lean = math.radians(start_deg), 0.3 * 600.0 / 900.0 / 1.2
    assert math.sin(state.theta6_rad) == pytest.approx(lean * math.cos(n), rel=1e-2, abs=1e-9)
    assert math.sin(state.theta5_rad) == pytest.approx(-lean * math.sin(n), rel=2e-2, abs=1e-9)


def test_the_rotator_alone_does_not_move_the_centre() -> None:
    """It is a pendulum of its own, however the grapple turns about it."""
    crane = Crane(changed_parameters([*POINTS, *LOG, "log.off_centre_m=0.03"]))
    crane.step(TICK_S, {})
    rotator = crane.around.rotator
    assert rotator

    def centre() -> tuple[float, float]:
        n, of = rotator.axis.position, 0.03 * 600.0 / 900.0
        out = -1.2 * math.sin(crane.state.theta6_rad) + of * math.cos(n)
        return out, 1.2 * math.sin(crane.state.theta5_rad) + of * math.sin(n)

    first, omega = centre()[0], math.sqrt(9.81 / 1.2)
    for tick in range(1, 400):
        crane.step(TICK_S, {ROTATOR: 1.0})
        phase = omega * tick * TICK_S
        out, across = centre()
        assert out == pytest.approx(first * math.cos(phase), abs=1e-3)
        assert across == pytest.approx(0.0, abs=1e-3)
    assert rotator.axis.position > 6.0


def test_a_point_in_the_grapple_has_no_planes() -> None:
    assert swung(turn=1.0, sway=Sway(0.1, 0.2)) == swung(sway=Sway(0.1, 0.2))


def rear() -> Deployment:
    return one_crane(read(CONFIG / "two-cranes.yaml"), "rear")


@pytest.mark.parametrize("machine", ["tip", TIP_CONTROLLER])
def test_the_frames_of_its_valve_turn_it(machine: str) -> None:
    deployment = rear()
    parameters = changed_parameters(["log.grip_s=0", "log.length_m=4"])
    plant = PlantNode(deployment, parameters, machine)
    valve = deployment.axes[ROTATOR].valve
    plant.receive(command_frame(valve, valve.steps))
    for _ in range(50):
        plant.advance(TICK_S)
    rotator = plant.crane.around.rotator
    assert rotator
    assert 0.1 < rotator.axis.position < 0.3  # until its timeout, and on with its lag
