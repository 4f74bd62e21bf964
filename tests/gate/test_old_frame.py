"""A joystick frame with a stamp of long ago: a stop through the filter, and nothing is refused."""

from typing import Any

import pytest

from canshaper.controller.controller import Controller
from canshaper.controller.guarded import Guarded
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason, State
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped

TICK_NS = 20_000_000
HOUR_NS = 3_600_000_000_000


@pytest.mark.parametrize("goes_on", [False, True])
@pytest.mark.parametrize("command", [1.0, 0.4, -1.0, 0.0])
def test_a_stamp_of_an_hour_ago(command: float, goes_on: bool) -> None:
    deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
    controller, hand = Controller(deployment), Hand(deployment)
    guarded = Guarded(controller)
    axis = controller.axes["slew"].axis
    number = 0
    seen: list[tuple[State, Reason]] = []
    events: list[Any] = []

    def drive(ticks: int, slew: float | None, age_ns: int = 0) -> None:
        nonlocal number
        for _ in range(ticks):
            number += 1
            now_ns = HOUR_NS + number * TICK_NS
            if slew is not None:
                for frame in hand.frames(number * 20, Held({"slew": slew}, enable=True)):
                    guarded.receive(frame, now_ns - age_ns)
            list(guarded.tick(now_ns))
            seen.append((axis.state, axis.reason))
            events.extend(controller.events)
            controller.events.clear()

    drive(10, 0.0)
    drive(60, 1.0)
    assert axis.raw > 60
    drive(1, command, HOUR_NS)
    assert seen[-1] == (State.STOPPING, Reason.JOYSTICK_TIMEOUT)
    drive(20, command if goes_on else None, HOUR_NS)
    drive(150, None)
    assert not any("output=refused" in event.text for event in events)
    assert seen[-1][0] is State.NEUTRAL_WAIT
    assert axis.raw == 0
