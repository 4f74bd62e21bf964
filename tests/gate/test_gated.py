"""The controller behind the gate: what goes through, and what is left where even neutral moves."""

import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from canshaper import gate
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.controller.gated import QUIET_NS, GatedController
from canshaper.machine.binding import load_deployment
from canshaper.shaping.states import Reason
from canshaper_sim.hand import Hand, Held
from tests.faults import shipped
from tests.promises.world import World
from tests.rigs.files import Machine

TICK_NS = 20_000_000


class Stuck(Controller):
    """Whose neutral moves."""

    def refused(self, frame: Frame) -> Frame:
        super().refused(frame)
        return frame


class Wrong:
    """The forwarder at rest, whose slew command is wrong in every tick."""

    def __init__(self, kind: type[Controller] = Controller) -> None:
        deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
        self.controller = kind(deployment)
        self.gated, self.hand = GatedController(self.controller), Hand(deployment)
        self.valve = deployment.axes["slew"].valve
        self.control = self.controller.axes["slew"]
        self.sound, self.control._put = self.control._put, lambda raw, _: self.sound(raw, 99)
        self.number = 0

    def tick(self) -> list[Frame]:
        """The slew frames of a tick."""
        now_ns = self.number * TICK_NS
        for frame in self.hand.frames(self.number * 20, Held(enable=True)):
            self.gated.receive(frame, now_ns)
        self.number += 1
        key = self.valve.message.key
        return [frame for frame in self.gated.tick(now_ns) if frame[:3] == key]


def test_one_that_goes_on_is_logged_once_a_second() -> None:
    wrong = Wrong(Stuck)
    for _ in range(QUIET_NS // TICK_NS):
        wrong.tick()
    refused = [e for e in wrong.controller.events if "output=refused" in e.text]
    assert len(refused) == 1
    wrong.tick()
    assert sum("output=refused" in e.text for e in wrong.controller.events) == 2


def test_a_tick_whose_neutral_is_refused_too_leaves_no_gap_in_the_count() -> None:
    wrong = Wrong()
    wrong.control._put = wrong.sound
    for _ in range(3):
        assert wrong.tick()
    sound = wrong.control.valve._encode
    wrong.control.valve._encode = lambda raw: sound(raw)[:-1]  # type: ignore[method-assign]
    assert not wrong.tick()
    wrong.control.valve._encode = sound  # type: ignore[method-assign]
    assert wrong.tick()
    assert wrong.tick()


def test_what_the_loop_says_reaches_the_controller() -> None:
    wrong = Wrong()
    wrong.control._put = wrong.sound
    (frame,) = wrong.tick()
    assert not wrong.gated.moves
    assert not wrong.gated.withhold(frame)
    with patch.object(Controller, "withhold", lambda *_: True):  # as if it moved
        assert wrong.gated.withhold(frame)
    wrong.gated.send_failed(frame)
    assert wrong.controller.counters.last_fault is FrameFault.SEND_FAILED
    wrong.tick()
    wrong.gated.stalled()
    assert wrong.gated._gate.stood
    wrong.tick()
    assert wrong.controller.axes["slew"].axis.reason is Reason.JOYSTICK_TIMEOUT


def disagreeing(change: str) -> tuple[Controller, list[Frame]]:
    """The forwarder moves slew; from a moment on the controller's decoder reads something else."""
    deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
    controller = Controller(deployment)
    gated, hand = GatedController(controller), Hand(deployment)
    left: list[Frame] = []
    joystick = controller.joysticks["left"]
    sound = joystick._decode
    for number in range(30):
        if number == 20:

            def decode(data: bytes) -> Any:
                raw = sound(data)
                if change == "late":  # the sequence seems to have stood
                    return raw | {"AliveCounter": 0}
                return raw | {"Slew": 1000 if change == "value" else 32766}

            joystick._decode = decode  # type: ignore[method-assign]
        held = Held({"slew": 0.5 if number > 5 else 0.0}, enable=True)
        for frame in hand.frames(number * 20, held):
            gated.receive(frame, number * TICK_NS)
        frames = [f for f in gated.tick(number * TICK_NS) if f.can_id == 512]
        left += frames if number >= 20 else []
    return controller, left


@pytest.mark.parametrize("change", ["value", "fault", "late"])
def test_two_decoders_that_disagree_stop_at_once(change: str) -> None:
    controller, left = disagreeing(change)
    assert {frame.data[0] for frame in left} == {0}
    texts = [event.text for event in controller.events]
    said = [text for text in texts if "decoders=disagree axis=slew" in text]
    assert len(said) == 1
    assert controller.axes["slew"].axis.reason is Reason.OUTPUT_REFUSED
    assert not any("output=refused" in text and "id=0x201" in text for text in texts)


@pytest.mark.parametrize(
    "name", ["Open circuit", "Fehler", "Short circuit", "Signal lost", "Virhe"]
)
def test_a_broken_wire_moves_nothing(name: str, machine: Machine) -> None:
    """The DBC names a code within the range; to the codecs it may be full speed."""
    machine.in_dbc("VAL_ 272 Slew", f'VAL_ 272 Slew -1000 "{name}"')
    machine.in_yaml("signal: Slew, neutral_pct: 2", f'signal: Slew, codes: {{ "{name}": fault }}')
    deployment = machine.load()
    controller = Controller(deployment)
    gated, hand = GatedController(controller), Hand(deployment)
    moved = set()
    for number in range(60):
        for frame in hand.frames(number * 20, Held(enable=True)):
            if frame.can_id == 272 and number > 5:
                frame = frame._replace(data=struct.pack("<h", -1000) + frame.data[2:])  # noqa: PLW2901
            gated.receive(frame, number * TICK_NS)
        moved |= {f.data[0] for f in gated.tick(number * TICK_NS) if f.can_id == 512}
    assert moved == {0}


def test_what_is_no_frame_of_a_tick_is_looked_at_too() -> None:
    wrong = Wrong()
    assert wrong.gated.passes(Frame("crane", 0x300, False, bytes(8)), 0)
    assert not wrong.gated.passes(Frame("crane", 0x601, False, bytes(8)), 0)
    assert "limit=identifier" in wrong.controller.events[-1].text
    wrong.controller.events.clear()
    assert not wrong.gated.passes(Frame("crane", 0x601, False, bytes(8)), 1)
    assert not wrong.controller.events


class Extra(Controller):
    """Which sends more than its valves and its status."""

    def tick(self, now_ns: int, missed: int = 0) -> Iterator[Frame]:
        yield from super().tick(now_ns, missed)
        yield Frame("crane", 0x601, False, bytes(8))


def test_a_frame_that_is_none_of_ours_is_left_out() -> None:
    deployment = load_deployment(shipped.CONFIG / "forwarder.yaml")
    controller = Extra(deployment)
    gated = GatedController(controller)
    assert 0x601 not in {frame.can_id for frame in gated.tick(TICK_NS)}
    assert "limit=identifier" in controller.events[-1].text
    assert not any(
        control.axis.reason is Reason.OUTPUT_REFUSED for control in controller.axes.values()
    )


def test_numbers_and_demands_reach_the_gate() -> None:
    wrong = Wrong()
    wrong.gated._gate.axes["slew"].of.ranges = {"limits.max_pct": (20.0, 80.0)}
    wrong.gated.set({"axes.slew.limits.max_pct": 50.0})
    assert wrong.gated._gate.axes["slew"].of.maximum == 0.5
    wrong.gated.demand("slew", 0.5)
    assert wrong.gated._gate.axes["slew"].ramp


def test_the_closure_of_the_gate_is_the_standard_library_and_itself() -> None:
    """All that is loaded with the gate, but for the packages above it, in a process of its own."""
    program = "import sys; from canshaper.gate import build, cycle, gate; print(*sys.modules)"
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    ours = {name for name in result.stdout.decode().split() if name.startswith("canshaper")}
    files = {file.stem for file in Path(gate.__path__[0]).glob("*.py")} - {"__init__"}
    assert ours == {"canshaper", "canshaper.gate", *(f"canshaper.gate.{name}" for name in files)}
    others = {name.partition(".")[0] for name in result.stdout.decode().split()}
    assert not others & {"cantools", "can", "pydantic", "yaml", "bitstruct", "crccheck"}


def test_a_reload_goes_on_where_the_gate_was() -> None:
    wrong = Wrong()
    wrong.tick()
    before, after = wrong.gated, GatedController(Controller(wrong.controller.deployment))
    after.carry_over(before)
    assert after._gate.axes["slew"].latched
    counts = [[valve.count for valve in one._gate.valves.values()] for one in (before, after)]
    assert counts[0] == counts[1] != [None] * len(counts[0])


@pytest.mark.parametrize(
    ("stick", "first", "second"), [(0.5, 0.0, 0.05), (-0.5, -0.096, -0.3)], ids=["faster", "back"]
)
def test_two_frames_of_a_joystick_in_a_tick(stick: float, first: float, second: float) -> None:
    """The second one may not be faster, nor go the other way: no time has passed."""
    world = World("gateway-forwarder")
    world.go(25)
    world.go(20, slew=0.5)
    world.go(1, slew=stick)
    axis, (frame, *_) = world.gated._gate.axes["slew"], world.left
    speed = (world.decode("slew", frame.data) or 0) / world.axes["slew"].steps
    for change, latched in ((first, False), (second, True)):
        world.evil.plant = world.commands(slew=speed + change)
        world.receive(world.joystick("left"))
        assert axis.latched is latched


@pytest.mark.parametrize(
    ("speed", "stick", "then", "latched"),
    [(0.4, 1.0, 0.59, False), (0.4, 1.0, 0.593, True), (0.4, 0.4, 0.209, False),
     (0.4, 0.4, 0.207, True), (0.145, -1.0, -0.145, False), (0.145, -1.0, -0.15, True)],
)  # fmt: skip
def test_a_joystick_of_every_second_tick(
    speed: float, stick: float, then: float, latched: bool
) -> None:
    """In a gateway rates count from the last frame: 0.19 of full command in two ticks."""
    world = World("gateway-forwarder")
    world.go(25)
    world.go(150, slew=(speed - 0.05) / 0.95 + 0.01)
    axis = world.gated._gate.axes["slew"]
    world.go(2, world.commands(slew=speed), slew=abs(stick))
    world.go(1, world.commands(slew=speed), slew=stick)
    world.change = lambda frame: []
    world.step()
    world.evil.plant = world.commands(slew=then)
    world.receive(world.joystick("left"))
    assert axis.latched is latched
