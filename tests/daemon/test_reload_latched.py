"""Latched states outlive a reload, and nothing else of the controller before does."""

import gc
import weakref
from collections.abc import Callable

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.adjust import Adjuster
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason, State
from tests.daemon.bench import FOREIGN, Bench, at
from tests.rigs.files import ROOT
from tests.rigs.forwarder import Rig


def test_a_trip_is_still_there_after_a_reload_and_asks_for_a_reset(bench: Bench) -> None:
    states: list[tuple[str, str]] = []

    def script(tick: int) -> None:
        bench.joysticks(Reset=int(tick in (200, 201)))
        if tick == 5:
            bench.put(FOREIGN)
        if tick in (9, 199, 205):
            states.append(bench.reported())
        if tick == 9:
            bench.reload()
        if tick == 205:
            bench.stop()

    bench.run(script)
    assert states == [("TRIPPED", "SECOND_SENDER")] * 2 + [("READY", "JOYSTICK_NEUTRAL")]


def test_whatever_was_latched_is_so_after_it_a_lost_address_too(rig: Rig) -> None:
    """Since the axis moved when the address was lost, other reasons to stop may have come."""
    axes = rig.controller.axes
    axes["slew"].stops.trip = Reason.EMERGENCY_STOP
    axes["near_far"].stops.trip = Reason.ADDRESS_LOST
    rig.run(3)
    assert [rig.state(axis) for axis in axes] == [State.TRIPPED, State.TRIPPED, State.READY]
    before, rig.controller = rig.controller, Controller(rig.deployment)
    rig.controller.carry_over(before)
    rig.run(3)
    assert (rig.state("slew"), rig.reason("slew")) == (State.TRIPPED, "EMERGENCY_STOP")
    assert (rig.state("near_far"), rig.reason("near_far")) == (State.TRIPPED, "ADDRESS_LOST")
    assert rig.state("lift") is State.READY
    rig.run(1, Reset=1)
    rig.run(1)
    assert [rig.state(axis) for axis in axes] == [State.READY] * 3


def test_a_reset_that_is_held_through_a_reload_is_no_press(rig: Rig) -> None:
    rig.controller.axes["slew"].stops.trip = Reason.EMERGENCY_STOP
    rig.run(3, Reset=1)
    before, rig.controller = rig.controller, Controller(rig.deployment)
    rig.controller.carry_over(before)
    rig.run(10, Reset=1)
    assert rig.state("slew") is State.TRIPPED


def test_an_axis_that_is_new_begins_as_ever(changed_rig: Callable[..., Rig], rig: Rig) -> None:
    other = changed_rig({"  lift:\n": "  boom:\n"})
    other.controller.carry_over(rig.controller)
    other.run(3)
    assert other.state("boom") is State.READY


# -- what was before -------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["forwarder-robust", "j1939-forwarder", "canopen-forwarder"])
def test_nothing_is_left_of_the_controller_before(kind: str) -> None:
    """Without the collector, which never looks through what was there at the start again."""
    deployment = load_deployment(ROOT / "config" / f"{kind}.yaml")
    controller = Controller(deployment)
    for now_ns in range(0, 400_000_000, 20_000_000):
        for _ in controller.tick(now_ns):
            pass
    after = Controller(load_deployment(deployment.path))
    after.carry_over(controller)
    adjuster = Adjuster(controller)
    parts = [controller, deployment, *controller.axes.values()]
    gone = [weakref.ref(part) for part in parts]
    gc.disable()
    try:
        del controller, adjuster, deployment, parts
        assert [one() for one in gone] == [None] * len(gone)
        assert after.neutral
    finally:
        gc.enable()


def test_a_reload_after_a_fault_warns_of_no_fault(
    bench: Bench, caplog: pytest.LogCaptureFixture
) -> None:
    """Its counters begin again without one; a fault that comes then is one to warn of."""
    short = lambda: bench.put(Frame("crane", 0x110, False, b""))  # noqa: E731
    at(bench, {5: short, 100: bench.reload, 200: short}, last=300)
    warned = [text.split()[0] for text in caplog.messages if text.startswith("fault=")]
    assert warned == ["fault=WRONG_LENGTH", "fault=WRONG_LENGTH"]
