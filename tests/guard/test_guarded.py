"""The controller behind the guard: what goes through, and what is left where even neutral moves."""

import pytest

from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.guarded import QUIET_NS, Guarded
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped

TICK_NS = 20_000_000


class Stuck(Controller):
    """Whose neutral moves."""

    def refused(self, frame: Frame) -> Frame:
        super().refused(frame)
        return frame


class FullSpeed(Controller):
    """Whose frames through the gateway all command full slew."""

    def receive(self, frame: Frame, arrived_ns: int) -> Frame | None:
        passed = super().receive(frame, arrived_ns)
        if passed is None or passed.can_id != 272:
            return passed
        runner = self.axes["slew"]
        runner.put(runner.bound.valve.steps)
        data = runner.valve.fields.layout.encode(runner.valve.raw)
        return passed._replace(data=data)


class Wrong:
    """The forwarder at rest, whose slew command is wrong in every tick."""

    def __init__(self, kind: type[Controller] = Controller) -> None:
        deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
        self.controller = kind(deployment)
        self.guarded, self.hand = Guarded(self.controller), Hand(deployment)
        self.valve = deployment.axes["slew"].valve
        self.runner = self.controller.axes["slew"]
        self.sound, self.runner._put = self.runner._put, lambda raw, _: self.sound(raw, 99)
        self.number = 0

    def tick(self) -> list[Frame]:
        """The slew frames of a tick."""
        now_ns = self.number * TICK_NS
        for frame in self.hand.frames(self.number * 20, Held(enable=True)):
            self.guarded.receive(frame, now_ns)
        self.number += 1
        key = self.valve.message.key
        return [frame for frame in self.guarded.tick(now_ns) if frame[:3] == key]


def test_where_even_neutral_moves_nothing_leaves() -> None:
    wrong = Wrong(Stuck)
    assert not any(wrong.tick() for _ in range(5))
    assert wrong.controller.counters.last_fault is FrameFault.OUTPUT_REFUSED


def test_one_that_goes_on_is_logged_once_a_second() -> None:
    wrong = Wrong(Stuck)
    for _ in range(QUIET_NS // TICK_NS):
        wrong.tick()
    refused = [e for e in wrong.controller.events if "output=refused" in e.text]
    assert len(refused) == 1
    wrong.tick()
    assert sum("output=refused" in e.text for e in wrong.controller.events) == 2


def test_in_the_place_of_a_wrong_one_neutral_leaves() -> None:
    wrong = Wrong()
    frames = [frame for _ in range(3) for frame in wrong.tick()]
    assert len(frames) == 3
    for frame in frames:
        assert wrong.valve.read(wrong.valve.message.fields.layout.decode(frame.data)) == 0
    assert wrong.controller.counters.last_fault is FrameFault.OUTPUT_REFUSED


def test_what_a_gateway_passes_on_is_looked_at_too() -> None:
    deployment = load_deployment(shipped.CONFIG / "gateway-forwarder.yaml")
    controller = FullSpeed(deployment)
    guarded, hand = Guarded(controller), Hand(deployment)
    valve = controller.axes["slew"].bound.valve
    left = []
    for number in range(10):
        for frame in hand.frames(number * 20, Held(enable=True)):
            left.append(guarded.receive(frame, number * TICK_NS))
        left += guarded.tick(number * TICK_NS)
    raws = [valve.message.fields.layout.decode(f.data) for f in left if f and f[1] == 272]
    assert raws
    assert {valve.read(raw) for raw in raws} == {0}
    (refusal,) = [e for e in controller.events if "output=refused" in e.text]
    assert "0x110" in refusal.text
    assert "axis=slew limit=asked" in refusal.text
    assert controller.axes["slew"].axis.reason is Reason.OUTPUT_REFUSED


@pytest.mark.parametrize("name", shipped.NAMES)
def test_the_last_frames_are_neutral(name: str) -> None:
    deployment = load_deployment(shipped.CONFIG / f"{name}.yaml")
    controller = Controller(deployment)
    guarded = Guarded(controller)
    keys = {axis.valve.message.key for axis in deployment.axes.values()}
    # J1939 has to have an address, and a gateway that rests sends nothing of its own.
    hand, tick_ms = Hand(deployment), deployment.config.tick_ms
    for number in range(1000 // tick_ms):
        now_ns = number * tick_ms * 1_000_000
        speed = 0.5 if number * tick_ms > 500 else 0.0
        held = Held(dict.fromkeys(deployment.axes, speed), enable=True)
        for frame in hand.frames(number * tick_ms, held):
            guarded.receive(frame, now_ns)
        assert all(guarded.tick(now_ns))
    assert not any("output=refused" in event.text for event in controller.events)
    if name.startswith("j1939"):  # whose joysticks may have any address
        assert all(controller.axes[axis].axis.raw for axis in ("slew", "near_far"))
    left = [frame[:3] for frame in guarded.neutral_frames()]
    assert keys == set(left)
    assert left == [frame[:3] for frame in controller.neutral_frames()]
    bound = next(iter(deployment.axes.values()))
    valve, put = bound.valve, bound.valve.put
    valve.put = lambda raw, _steps: put(raw, 99)  # type: ignore[method-assign]
    missing = keys - {f[:3] for f in guarded.neutral_frames()}
    assert missing == {valve.message.key}


def test_what_the_loop_says_reaches_the_controller() -> None:
    wrong = Wrong()
    wrong.runner._put = wrong.sound
    (frame,) = wrong.tick()
    assert not wrong.guarded.moves
    assert not wrong.guarded.withhold(frame)
    wrong.guarded.send_failed(frame)
    assert wrong.controller.counters.last_fault is FrameFault.SEND_FAILED
    wrong.tick()
    wrong.guarded.stalled()
    assert wrong.guarded._guard._stood_still
    wrong.tick()
    assert wrong.controller.axes["slew"].axis.reason is Reason.JOYSTICK_TIMEOUT
