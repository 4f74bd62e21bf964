"""Hands that do something else than they were told: what is missing, and what to do."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from canshaper.cli.person import Terminal
from canshaper.commissioning.procedure.bench import Simulated, Task
from canshaper.commissioning.procedure.files import Files
from canshaper.commissioning.procedure.procedure import Procedure, Proposal
from canshaper.commissioning.procedure.steps import STEPS
from canshaper.machine.binding import load_deployment
from canshaper_sim.strokes import Script, Stroke


class Otherwise(Simulated):
    """The simulated crane, whose operator has a mind of his own."""

    def __init__(self, change: Any) -> None:
        super().__init__(Terminal(), [])
        self._change = change

    def drive(self, deployment: Any, log: Path, task: Task) -> None:
        super().drive(deployment, log, self._change(task))


def run(machine: Path, step: str, change: Any) -> Proposal:
    one = Procedure(Files(machine), Otherwise(change), load_deployment, STEPS, origin=machine)
    return one.run(one.step(step))


def strokes(change: Any) -> Any:
    def changed(task: Task) -> Task:
        moved = [new for one in task.script.strokes for new in change(one)]
        return replace(task, script=Script("other", tuple(moved), task.script.duration_s))

    return changed


def inverted(one: Stroke) -> list[Stroke]:
    return [replace(one, level=-one.level)]


def shorter(one: Stroke) -> list[Stroke]:
    return [replace(one, level=0.6 * one.level)]


def none(_one: Stroke) -> list[Stroke]:
    return []


def both(one: Stroke) -> list[Stroke]:
    return [replace(one, axis="slew"), replace(one, axis="near_far")]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (inverted, "slew: went to negative values first: swap the sign of JoystickLeft.Slew"),
        (shorter, "slew: reached -60 to 60 %: move it to both ends"),
        (none, "slew: no signal moved: was it the right joystick?"),
        (both, "slew: several moved (JoystickLeft.Slew, JoystickLeft.NearFar)"),
    ],
)
def test_joysticks_moved_otherwise(machine: Path, change: Any, text: str) -> None:
    before = machine.read_bytes()
    found = run(machine, "joysticks", strokes(change))
    assert found.poor[0].startswith(text)
    assert not found.diff
    assert machine.read_bytes() == before


def test_joysticks_without_enable(machine: Path) -> None:
    found = run(machine, "joysticks", lambda task: replace(task, released=(0.0, 9.0)))
    assert found.poor[0].startswith("slew: the enable switch was not seen held")


def test_a_dry_drive_without_one_axis(machine: Path) -> None:
    found = run(machine, "dry", strokes(lambda one: [one] if one.axis == "slew" else []))
    assert [fault.partition(":")[0] for fault in found.poor] == ["near_far", "lift"]


def test_a_dry_drive_without_enable(machine: Path) -> None:
    found = run(machine, "dry", lambda task: replace(task, released=(0.0, 100.0)))
    assert "slew: it was never ACTIVE, but NEUTRAL_WAIT (ENABLE_OFF)" in found.poor[0]


def test_a_first_motion_to_one_side(machine: Path) -> None:
    change = strokes(lambda one: [replace(one, level=abs(one.level))])
    found = run(machine, "motion", change)
    assert {fault.partition(":")[0] for fault in found.poor} == {"slew", "near_far", "lift"}
    assert "its valve did not follow its joystick in both directions" in found.poor[0]


def test_a_first_motion_with_the_enable_held_all_the_time(machine: Path) -> None:
    found = run(machine, "motion", lambda task: replace(task, released=None))
    assert found.poor == [
        "the enable was not let go while an axis moved, or is in no message of a joystick: let it"
        " go in motion; neutral has to follow at once"
    ]


def test_a_bus_on_which_nothing_comes(machine: Path) -> None:
    class Silent(Otherwise):
        def drive(self, deployment: Any, log: Path, task: Task) -> None:
            log.write_text("")

    bench = Silent(None)
    one = Procedure(Files(machine), bench, load_deployment, STEPS, origin=machine)
    found = one.run(one.step("buses"))
    assert any("bus crane: no frame was received: is the machine on" in f for f in found.poor)
