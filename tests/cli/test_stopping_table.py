"""Stopping distances that `check` shows: of the real axes of a deployment, at their worst."""

from io import StringIO

import pytest
from rich.console import Console

from canshaper.commissioning.stopping import print_stopping, stopping
from canshaper.machine.binding import load_deployment
from tests.controller.set_files import DBC, YAML
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Make


def test_the_distance_is_what_the_axis_travels(changed_rig: Make) -> None:
    """Frames in, frames out: from the last frame with full speed to rest, by the valve's frames."""
    rig = changed_rig().moving()
    rig.run(250, Slew=1000)
    axis = rig.controller.axes["slew"].axis
    way_s = axis.output.setpoint * 0.02
    for _ in range(150):
        rig.run(1)
        way_s += axis.output.setpoint * 0.02
    slew = next(one for one in stopping(rig.deployment) if one.name == "slew")
    assert slew.travel.release == pytest.approx(way_s, abs=1e-3)
    assert slew.cell(slew.travel.release) == f"{4.8 * way_s:.2f} m  {way_s * 28.648:.0f} deg"


def test_a_lost_joystick_is_counted_from_its_last_frame(changed_rig: Make) -> None:
    rig = changed_rig().moving()
    rig.run(250, Slew=1000)
    axis = rig.controller.axes["slew"].axis
    way_s = 0.0
    for _ in range(150):
        rig.tick()
        way_s += axis.output.setpoint * 0.02
    slew = next(one for one in stopping(rig.deployment) if one.name == "slew")
    assert way_s <= slew.travel.lost + 1e-9
    assert slew.travel.lost == pytest.approx(way_s, abs=0.021)  # of the last tick before silence


def test_the_worst_of_all_sets_and_feels_is_shown(changed_rig: Make) -> None:
    def release(calm: str) -> float:
        feel = "calm: { filter: { kind: gff, a1: 1.2, a2: 0.3 } }"
        key = next(iter(YAML))
        yaml = YAML | {key: YAML[key].replace(feel, calm)}
        assert yaml != YAML or feel == calm
        return stopping(changed_rig(yaml=yaml, dbc=DBC).deployment)[0].travel.release

    slow = release("calm: { filter: { kind: gff, a1: 1.2, a2: 0.3 } }")
    plain = release("calm: { filter: { kind: gff, a1: 0.5, a2: 0.06 } }")
    assert slow > plain + 0.05


@pytest.mark.parametrize(("name", "expected"), [("forwarder-robust", True), ("forwarder", False)])
def test_axes_of_a_motion_are_said_to_be_alone_in_it(name: str, expected: bool) -> None:
    console = Console(file=StringIO(), width=200)
    print_stopping(load_deployment(ROOT / "config" / f"{name}.yaml"), console)
    assert isinstance(console.file, StringIO)
    note = "slew, near_far: each of them alone; in their motion the way that one adds"
    assert (note in console.file.getvalue()) is expected
