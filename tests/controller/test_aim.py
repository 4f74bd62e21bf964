"""Aim point: where the tip will rest if the joysticks are let go now."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from canshaper.codec.frame import Frame
from canshaper.errors import ConfigError
from canshaper.shaping.states import State
from tests.rigs.files import ROOT, machine_file
from tests.rigs.forwarder import Make, Rig


@pytest.fixture
def rig() -> Rig:
    return Rig(ROOT / "config" / "forwarder-robust.yaml")


def aim(rig: Rig) -> dict[str, Any]:
    """The message that is sent next, every 100 ms."""
    (point,) = rig.controller.status.aims
    point.update()
    return {"slew": point.slew_deg, "radius": point.radius_m, "known": point.known}


def test_at_rest_it_is_the_tip(rig: Rig) -> None:
    rig.run(10)
    assert aim(rig) == {"slew": 0.0, "radius": 0.0, "known": True}


def test_it_is_the_way_that_the_axes_then_go(rig: Rig) -> None:
    """It counts the commands that the filters still give, and the lag of the valves."""
    rig.run(3)
    rig.run(60, Slew=600, NearFar=-800)
    said = aim(rig)
    lag = {
        name: 0.1 * control.axis.output.setpoint for name, control in rig.controller.axes.items()
    }
    slew = near_far = 0.0
    for _ in range(150):
        rig.run(1)
        slew += 0.02 * 28.648 * rig.controller.axes["slew"].axis.output.setpoint
        near_far += 0.02 * rig.controller.axes["near_far"].axis.output.setpoint
    assert said["known"] is True
    assert said["slew"] == pytest.approx(slew + 28.648 * lag["slew"], abs=0.2)
    assert said["radius"] == pytest.approx(near_far + lag["near_far"], abs=0.02)
    assert aim(rig)["slew"] == pytest.approx(0.0, abs=0.2)


def test_it_is_in_its_message_with_its_units(rig: Rig) -> None:
    rig.run(3)
    sent = [rig.run(1, Slew=1000) for _ in range(101)]
    at, message = next((k, one["AimPoint"]) for k, one in enumerate(sent) if "AimPoint" in one)
    again = [k for k, one in enumerate(sent) if "AimPoint" in one]
    assert {b - a for a, b in pairwise(again)} == {5}
    assert at < 5
    assert message["AimKnown"] == 1
    last = sent[again[-1]]["AimPoint"]
    assert last["AimSlew"] == pytest.approx(28.6 * 0.98, abs=1.5)


def test_after_a_reversal_it_is_not_known_until_the_filter_holds_one_direction(rig: Rig) -> None:
    rig.run(3)
    rig.run(60, Slew=1000)
    rig.run(20, Slew=-1000)
    assert aim(rig) == {"slew": 0.0, "radius": 0.0, "known": False}
    rig.run(120, Slew=-1000)
    assert aim(rig)["known"] is True
    assert aim(rig)["slew"] < -20.0


def test_a_trip_and_a_bypass_let_nothing_run_on(rig: Rig) -> None:
    rig.run(3)
    rig.run(60, Slew=1000)
    rig.run(2, Slew=1000, Enable=0)
    assert rig.state("slew") is State.TRIPPED
    assert aim(rig)["slew"] == 0.0
    rig = Rig(ROOT / "config" / "forwarder-robust.yaml")
    rig.run(3, AntiSwayOff=1)
    rig.run(60, Slew=1000, AntiSwayOff=1)
    assert aim(rig)["slew"] == pytest.approx(2.86, abs=0.05)  # the valve's lag


def test_it_is_not_known_while_another_set_is_in_force(tmp_path: Path) -> None:
    """The run-on is that of the axis' own filter."""
    aim_point = "    aim: { bus: crane, message: AimPoint }\n"
    aiming = ("    radius:", f"{aim_point}    radius:")
    rig = Rig(machine_file(tmp_path, "forwarder-load", aiming))
    rig.run(10)
    assert aim(rig)["known"] is True
    load = rig.message("GrappleLoad")
    data = load.encode({"Weight": 600, "Gripped": 1})
    rig.receive(Frame("crane", load.frame_id, False, data))
    rig.run(10)
    assert aim(rig)["known"] is False


def test_a_motion_of_one_axis_has_none(changed_rig: Make) -> None:
    motion = "motion: { crane: { slew: slew, aim: { bus: crane, message: AimPoint } } }\n"
    with pytest.raises(ConfigError, match="expected near_far with a radius or an aim, got none"):
        changed_rig({"axes:\n": f"{motion}axes:\n"})


def test_a_message_that_cannot_carry_it_is_refused(changed_rig: Make) -> None:
    aim = "aim: { bus: crane, message: ShaperStatus }"
    motion = f"motion: {{ crane: {{ slew: slew, near_far: near_far, {aim} }} }}\n"
    with pytest.raises(ConfigError, match="lacks the signals AimSlew, AimReach, AimKnown"):
        changed_rig({"axes:\n": f"{motion}axes:\n"})
