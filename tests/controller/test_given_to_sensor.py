"""Values that an axis hands to its sway sensor: swing of full speed, and whose it is."""

from pathlib import Path
from typing import NamedTuple

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.axis_control import AxisControl
from canshaper.controller.controller import Controller
from canshaper.design.lockstep import LockStep
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.axis import ShapedAxis
from canshaper.shaping.limits import OutputLimits
from canshaper.shaping.states import CommandInput
from canshaper.shaping.transfer import Off
from canshaper_sim.crane import CraneParameters
from canshaper_sim.joysticks import JoystickNode
from canshaper_sim.plant import PlantNode
from canshaper_sim.strokes import Script, Stroke
from tests.faults import shipped
from tests.rigs.files import machine_file

STROKES = (Stroke("near_far", 0.5, 2.5, 1.0, 0.1), Stroke("slew", 6.0, 6.0, 1.0, 0.1))
SLEWING = Script("slew", STROKES, 13.0)


class Given(NamedTuple):
    """With one measurement."""

    scale: float
    damps: object
    other: float | None


def given(control: AxisControl) -> list[Given]:
    """Record the values that the sensor of an axis is given from now on."""
    sensed = control.axis.sensed
    assert sensed is not None
    measure, seen = sensed.measure, []

    def spied(
        value: float | None, scale: float, *, commanded: bool, damps: bool, other: float | None
    ) -> None:
        seen.append(Given(scale, damps, other))
        measure(value, scale, commanded=commanded, damps=damps, other=other)

    sensed.measure = spied  # type: ignore[method-assign]
    return seen


def sensor_machine() -> Deployment:
    return load_deployment(shipped.CONFIG / "forwarder-sensor.yaml")


class Slewing:
    """A crane that slews while its trusted sensor lets near-far damp."""

    def __init__(self) -> None:
        deployment = sensor_machine()
        self.controller = Controller(deployment)
        plant = PlantNode(deployment, CraneParameters())
        hands = [JoystickNode(deployment, SLEWING)]
        self._lock_step = LockStep(deployment, self.controller, plant, hands)
        self.near_far = self.controller.axes["near_far"]
        self.seen = given(self.near_far)

    def until_it_damps(self) -> "Slewing":
        while not (self.seen and self.seen[-1].damps):
            assert self._lock_step.time_ms < 12000
            self._lock_step.step()
        return self

    def step(self) -> Given:
        self._lock_step.step()
        return self.seen[-1]


def test_by_the_radius_that_is_measured_and_by_the_last_when_that_is_lost() -> None:
    deployment = sensor_machine()
    controller = Controller(deployment)
    tip = deployment.messages.find("TipPosition")
    assert not isinstance(tip, str)
    seen = given(controller.axes["slew"])
    for number, radius_mm in enumerate((None, 3000, 6000, 100, *[None] * 20)):
        if radius_mm is not None:
            raw = {"SlewAngle": 0, "Radius": radius_mm, "Height": 0}
            data = tip[1].encode(raw, scaling=False)
            controller.receive(Frame("crane", tip[1].frame_id, False, data), number * 20_000_000)
        list(controller.tick(number * 20_000_000))
    unmeasured, at_3_m, at_6_m, at_pillar, *later = (one.scale for one in seen)
    per_m = at_3_m / 3.0
    assert unmeasured == pytest.approx(3.0 * per_m)  # 1.5 m/s in the file, 0.5 rad/s
    assert at_6_m == pytest.approx(6.0 * per_m)
    assert at_pillar == pytest.approx(0.5 * per_m)
    assert set(later) == {at_pillar}


def test_an_axis_that_nothing_moves_damps_no_swing_of_another() -> None:
    controller = Controller(sensor_machine())
    control = controller.axes["near_far"]
    assert control.added == 0.0
    controller.motions.clear()
    seen = given(control)
    list(controller.tick(0))
    assert [one.damps for one in seen] == [False]


def test_near_far_is_given_what_slewing_alone_would_show_across() -> None:
    drive = Slewing().until_it_damps()
    before = drive.seen[-2]
    assert (before.damps, before.other) == (False, None)
    for _ in range(50):
        drive.step()
    slew = drive.controller.axes["slew"]
    assert drive.step().other == pytest.approx(slew.own_swing(0), rel=0.01) != 0.0


def test_a_sensor_of_another_kind_shows_nothing_of_that(tmp_path: Path) -> None:
    angle, rate = "SwayAngle, signal: Across, kind: angle", "SwayRate, signal: Across, kind: rate"
    file = machine_file(tmp_path, "forwarder-sensor", (angle, rate))
    assert Controller(load_deployment(file)).axes["near_far"].other is None


def test_and_its_filter_is_carried_out_for_that(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = Slewing().until_it_damps()
    command, carried = ShapedAxis.command, []

    def spied(
        axis: ShapedAxis, joystick: CommandInput, added: float, *, damps: bool = False
    ) -> object:
        if axis is drive.near_far.axis:
            carried.append(damps)
        return command(axis, joystick, added, damps=damps)

    monkeypatch.setattr(ShapedAxis, "command", spied)
    drive.step()
    assert carried == [True]


def test_not_in_the_very_tick_in_which_slew_trips() -> None:
    drive = Slewing().until_it_damps()
    drive.controller.send_failed(Frame("crane", 512, False, bytes(2)))
    assert drive.step().damps is False


def test_not_when_it_is_measured_alone() -> None:
    drive = Slewing().until_it_damps()
    drive.near_far.isolate(drive.controller.joysticks["left"])
    assert drive.step().damps is False


def test_a_valve_that_is_measured_with_an_axis_of_its_own_needs_no_sensor() -> None:
    drive = Slewing().until_it_damps()
    own = ShapedAxis(0.02, OutputLimits(), sway=None, shaper=Off())
    drive.near_far.isolate(drive.controller.joysticks["left"], own)
    before = len(drive.seen)
    drive.step()
    assert len(drive.seen) == before
