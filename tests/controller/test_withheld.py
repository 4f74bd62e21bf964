"""A valve frame that was too late and did not leave: the next one has its count, and leaves."""

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.shaping.states import State
from canshaper_sim.hand import Hand, Held
from tests.gate.bench import load

TICK_NS = 20_000_000
MOVING = 50


def test_the_motion_goes_on_without_a_gap_in_the_counter() -> None:
    deployment = load("forwarder")
    controller = Controller(deployment)
    gated, hand = GatedController(controller), Hand(deployment)
    message = deployment.axes["near_far"].valve.message
    left: list[Frame] = []
    for number in range(MOVING + 5):
        position = 0.5 if number > 5 else 0.0
        for frame in hand.frames(number * 20, Held({"near_far": position}, enable=True)):
            gated.receive(frame, number * TICK_NS)
        for frame in gated.tick(number * TICK_NS):
            if frame[:3] != message.key:
                continue
            if number == MOVING:
                assert gated.withhold(frame)
            else:
                left.append(frame)
    assert not any("output=refused" in event.text for event in controller.events)
    assert controller.axes["near_far"].axis.state is State.ACTIVE
    counts = [message.fields.layout.decode(frame.data)["AliveCounter"] for frame in left]
    assert counts == list(range(1, MOVING + 5))
