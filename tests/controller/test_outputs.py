"""A neutral frame takes the place of a valve frame that the gate has refused."""

import pytest

from canshaper.codec.e2e import E2e
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped
from tests.rigs.forwarder import Make


def driven(name: str) -> Controller:
    """All axes of a shipped deployment in motion."""
    deployment = load_deployment(shipped.CONFIG / f"{name}.yaml")
    controller, hand = Controller(deployment), Hand(deployment)
    for number in range(80):
        pushed = 1.0 if number > 20 else 0.0
        held = Held(dict.fromkeys(deployment.axes, pushed), enable=True)
        for frame in hand.frames(number * 20, held):
            controller.receive(frame, number * 20_000_000)
        list(controller.tick(number * 20_000_000))
    assert all(control.axis.output.steps for control in controller.axes.values())
    return controller


@pytest.mark.parametrize("name", ["forwarder", "canfd-forwarder", "gateway-forwarder"])
def test_all_axes_of_its_message_are_neutral(name: str) -> None:
    """A plain frame, one with a checksum, one with two axes."""
    controller = driven(name)
    for control in controller.axes.values():
        frame = control.valve.frame()
        neutral = controller.refused(frame)
        assert neutral[:3] == frame[:3]
        for of in controller.axes.values():
            if of.valve is control.valve:
                raw = of.valve.fields.layout.decode(neutral.data)
                assert of.bound.valve.read(raw) == 0


def test_it_has_the_count_of_the_refused_one() -> None:
    """Its receiver sees no gap."""
    controller = driven("canfd-forwarder")
    control = controller.axes["slew"]
    check = control.bound.valve.message.protection.check
    assert isinstance(check, E2e)
    frame = control.valve.frame()
    neutral = controller.refused(frame)
    assert check.verify(neutral.data)
    assert check.count(neutral.data) == check.count(frame.data)


def test_its_axes_trip_with_the_next_tick(changed_rig: Make) -> None:
    rig = changed_rig().moving()
    rig.controller.refused(rig.run(1, Slew=1000)["SlewCommand"][""])
    assert rig.controller.axes["slew"].stops.trip
    assert not rig.controller.axes["near_far"].stops.trip
    rig.run(1, Slew=1000)
    assert rig.reason() == Reason.OUTPUT_REFUSED.name


def test_a_frame_moves_while_any_axis_in_it_does() -> None:
    """One that is too late must not leave then: slew moves, near-far behind it rests."""
    deployment = load_deployment(shipped.CONFIG / "gateway-forwarder.yaml")
    controller, hand = Controller(deployment), Hand(deployment)
    controller.motions.clear()
    slew, near_far = (controller.axes[name].axis for name in ("slew", "near_far"))
    moves = []
    for number in range(150):
        time_ms = number * 20
        held = Held({"slew": 1.0 if time_ms > 400 else 0.0}, enable=True)
        for frame in hand.frames(time_ms, held) if time_ms < 2000 else ():  # then we stop the crane
            controller.receive(frame, time_ms * 1_000_000)
        for frame in controller.tick(time_ms * 1_000_000):
            if frame.can_id == 272 and slew.output.steps:
                assert not near_far.output.steps
                moves.append(controller.moves)
    assert moves
    assert all(moves)
