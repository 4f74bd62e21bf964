"""A button of a joystick chooses the next profile, in motion too, and no output jumps for it."""

from collections.abc import Callable

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import drive
from canshaper.errors import ConfigError
from canshaper.machine.binding import load_deployment
from canshaper.report.metrics import axis_metrics
from canshaper.shaping.states import State
from canshaper_sim.operator import Script, Stroke
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Rig as Forwarder
from tests.rigs.j1939 import Rig, bjm

FILE = ROOT / "config" / "j1939-profiles.yaml"
NORMAL, QUICK, FINE = range(3)
# The forwarder with its anti-sway switch as the button.
BUTTON = ("    anti_sway_off: AntiSwayOff\n", "    next_profile: AntiSwayOff\n")
SLEW = "full_speed_m_s: 1.5 }\n    filter: { kind: gff, a1: 0.708, a2: 0.12 }"
FAST = f"{SLEW}\n    profiles: {{ fast: {{ filter: {{ kind: gff, a1: 0.5, a2: 0.06 }} }} }}"


@pytest.fixture
def rig() -> Rig:
    rig = Rig(FILE)
    rig.run(20)
    return rig


def numbers(rig: Rig | Forwarder) -> set[int]:
    """Sets in force, of the axes that have profiles."""
    choosers = (control.chooser for control in rig.controller.axes.values())
    return {chooser.number for chooser in choosers if chooser}


def press(rig: Rig, ticks: int = 5, **left: float) -> None:
    """Press the left button, and let go of it."""
    rig.run(ticks, Button4=1, **left)
    rig.run(10 - ticks, **left)


def test_each_press_of_either_joystick_chooses_the_next_profile(rig: Rig) -> None:
    assert numbers(rig) == {NORMAL}
    press(rig)
    assert numbers(rig) == {QUICK}
    for _ in range(5):
        rig.tick(bjm("BJM1"), bjm("BJM2", Button4=1))
    assert numbers(rig) == {FINE}
    press(rig)
    assert numbers(rig) == {NORMAL}


def test_what_is_held_is_one_press(rig: Rig) -> None:
    rig.run(200, Button4=1)
    assert numbers(rig) == {QUICK}


def test_what_is_held_when_it_is_first_seen_is_no_press() -> None:
    rig = Rig(FILE)
    rig.run(50, Button4=1)
    assert numbers(rig) == {NORMAL}


@pytest.mark.parametrize("code", [2, 3])
def test_error_and_not_available_are_no_press_and_end_none(rig: Rig, code: int) -> None:
    rig.run(10, Button4=code)
    rig.run(10, Button4=1)
    assert numbers(rig) == {NORMAL}
    rig.run(10)
    press(rig)
    assert numbers(rig) == {QUICK}


def test_what_is_held_after_a_gap_was_not_pressed(rig: Rig) -> None:
    for _ in range(20):
        rig.tick(bjm("BJM2"))
    rig.run(20, Button4=1)
    assert numbers(rig) == {NORMAL}


def test_a_lost_joystick_changes_nothing(rig: Rig) -> None:
    press(rig)
    for _ in range(100):
        rig.tick()
    assert numbers(rig) == {QUICK}


def test_a_frame_that_does_not_count_is_no_press(changed_rig: Callable[..., Forwarder]) -> None:
    """Its alive counter stands still."""
    rig = changed_rig(yaml={BUTTON[0]: BUTTON[1], SLEW: FAST})
    rig.run(5)
    still = rig.joystick()

    def frame(pressed: int) -> Frame:
        rig.counts["JoystickLeft"] = (still.data[7] - 1) % 256
        return rig.joystick(AntiSwayOff=pressed)

    rig.receive(still)
    for _ in range(2):
        rig.receive(frame(1))
        rig.tick()
    assert numbers(rig) == {0}
    rig.counts["JoystickLeft"] = still.data[7]
    rig.receive(rig.joystick(AntiSwayOff=1))
    rig.tick()
    assert numbers(rig) == {1}


def test_a_button_is_a_signal_of_its_own(changed_rig: Callable[..., Forwarder]) -> None:
    with pytest.raises(ConfigError) as caught:
        changed_rig(yaml={BUTTON[0]: "    next_profile: Enable\n", SLEW: FAST})
    says = "joysticks.left.next_profile: expected a free signal, got 'Enable'"
    assert any(says in str(problem) for problem in caught.value.problems), caught.value.problems


def test_a_new_controller_begins_with_the_axis_own_filter(rig: Rig) -> None:
    press(rig)
    after = Controller(rig.deployment)
    after.carry_over(rig.controller)
    rig.controller = after
    rig.run(20, Button4=1)
    assert numbers(rig) == {NORMAL}


@pytest.mark.parametrize("released", [False, True])
@pytest.mark.parametrize("after_s", [0.1, 0.6, 1.6, 2.6])
@pytest.mark.parametrize("presses", [1, 2])
def test_in_motion_no_output_jumps(after_s: float, presses: int, *, released: bool) -> None:
    """Both axes at once, so long after press or release of the joystick."""
    rig, plain = Rig(FILE), Rig(FILE)
    for one in (rig, plain):
        one.run(20)
        if released:
            one.run(200, X=100.0, Y=100.0)
    joystick = {} if released else {"X": 100.0, "Y": 100.0}
    begin = round(after_s / 0.02)
    for tick in range(250):
        rig.run(1, Button4=int(tick in {begin + 10 * i for i in range(presses)}), **joystick)
        plain.run(1, **joystick)
        for axis in ("slew", "near_far"):
            one, other = (r.controller.axes[axis].axis.output.setpoint for r in (rig, plain))
            assert one == pytest.approx(other, abs=0.01)
    assert numbers(rig) == {presses}
    assert rig.state() is (State.READY if released else State.ACTIVE)


def test_on_the_way_to_a_speed_the_profile_waits(rig: Rig) -> None:
    rig.run(10, X=60.0)
    press(rig, X=60.0)
    control = rig.controller.axes["slew"]
    steady = 0
    for _ in range(200):
        rig.run(1, X=60.0)
        if numbers(rig) != {NORMAL, QUICK}:  # near-far is at rest
            break
        steady = steady + 1 if abs(control.axis.output.setpoint - 0.6) <= 0.02 else 0
    assert steady == 10
    assert numbers(rig) == {QUICK}
    assert control.axis.state is State.ACTIVE
    for tick in range(300):
        rig.run(1, X=50.0 + 40.0 * (tick // 20 % 2), Button4=int(tick == 100))
    assert rig.controller.axes["slew"].active_set == QUICK
    rig.run(150)
    assert numbers(rig) == {FINE}


class Restless:
    """Presses the button every 0.7 s."""

    def name(self, now_ns: int) -> str:
        """One after the other."""
        return ("", "quick", "fine")[now_ns // 700_000_000 % 3]


@pytest.mark.parametrize("axis", ["slew", "near_far"])
def test_a_press_while_profiles_change_leaves_the_swing_small(axis: str) -> None:
    """Without a filter it leaves 13 and 16 degrees; where no profile waits, up to 7."""

    def choose(controller: Controller) -> None:
        for control in controller.axes.values():
            if control.chooser:
                control.add_chooser(None, Restless())

    script = Script("press", (Stroke(axis, 0.5, 3.0, 1.0, 0.1),), 10.0)
    left = axis_metrics(drive(load_deployment(FILE), script, prepare=choose), axis).residual_deg
    assert left is not None
    assert left < 0.5
