"""What a reload carries over: what other nodes reported, what is latched, and every counter."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from canshaper.codec.codecs import Sender
from canshaper.codec.e2e import COUNTER, E2e
from canshaper.codec.frame import Frame, FrameFault
from canshaper.controller.controller import Controller
from canshaper.inputs.feedback import Following
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.shaping.states import State
from tests.machine.protected_machine import load
from tests.rigs.canopen import (
    BOOT_UP,
    OPERATIONAL,
    OURS,
    PRE_OPERATIONAL,
    CanopenRig,
    write_variant,
)
from tests.rigs.emergency import PRESSED, Machine
from tests.rigs.forwarder import ROOT, TICK_NS, Rig
from tests.rigs.gateway import GatewayRig
from tests.rigs.j1939 import AVC, CLAIM, DM1, OTHER, OWN, avef, bjm, ids
from tests.rigs.j1939 import Rig as J1939Rig

Make = Callable[..., Rig]
Sent = dict[tuple[str, int, bool], bytes]
FOREIGN = Frame("crane", 0x200, False, b"\0\0")
FLOW_COMMAND_LATE = 0x8003
BUS = "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"


def reload(rig: Any, *changes: tuple[str, str]) -> None:
    """The controller after a reload of the rig's file, with pieces of it replaced."""
    text = rig.deployment.path.read_text(encoding="utf-8")
    text = text.replace("../dbc", str(ROOT / "dbc"))
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    before, file = rig.controller, rig.deployment.path
    if changes:
        file = file.with_name("changed.yaml")
        file.write_text(text, encoding="utf-8")
    rig.deployment = load_deployment(file)
    before.neutral_frames()
    rig.controller = Controller(rig.deployment)
    rig.controller.carry_over(before)


@pytest.fixture
def canopen(tmp_path: Path) -> CanopenRig:
    return CanopenRig(write_variant(tmp_path)).ready()


@pytest.fixture
def j1939(tmp_path: Path) -> J1939Rig:
    text = (ROOT / "config" / "j1939-forwarder.yaml").read_text(encoding="utf-8")
    file = tmp_path / "machine.yaml"
    file.write_text(text.replace("../dbc", str(ROOT / "dbc")), encoding="utf-8")
    rig = J1939Rig(file).claimed()
    rig.run(5)
    return rig


# -- what we send ----------------------------------------------------------------------------------


def last_of(frames: list[Frame]) -> Sent:
    return {frame[:3]: frame.data for frame in frames}


def count_of(sender: Sender, data: bytes) -> int:
    """Alive counter of a frame of a message that has one."""
    protection = sender.protection
    if isinstance(protection.check, E2e):
        return data[1] & COUNTER
    return int(sender.fields.layout.decode(data)[protection.counter or ""])


def counts(deployment: Deployment, sent: Sent) -> dict[tuple[str, int, bool], int]:
    """Alive counter of every message that has one."""
    return {
        sender.key: count_of(sender, sent[sender.key])
        for sender in deployment.senders()
        if sender.protection.counts
    }


def test_every_counter_goes_on(rig: Rig) -> None:
    """The neutral frames before the reload counted."""
    sent: Sent = {}
    for _ in range(119):
        sent |= last_of([values[""] for values in rig.run(1).values()])
    before = counts(rig.deployment, sent)
    assert len(before) >= 3
    reload(rig)
    sent = last_of([values[""] for values in rig.run(1).values()])
    assert counts(rig.deployment, sent) == {key: (n + 2) % 256 for key, n in before.items()}


def test_every_counter_of_e2e_goes_on(tmp_path: Path) -> None:
    """Of valves, of an axis, and of the service, in the profiles and with a counter of its own."""
    before, after = load(tmp_path), load(tmp_path)
    first, second = Controller(before), Controller(after)
    sent: Sent = {}
    for number in range(6):
        sent |= last_of(list(first.tick(number * TICK_NS)))
    second.carry_over(first)
    later = counts(after, last_of(list(second.tick(6 * TICK_NS))))
    assert later == {key: count + 1 for key, count in counts(before, sent).items()}
    assert sorted(later.values()) == [3, 3, 7]


def test_the_counter_of_a_gateway_goes_on(tmp_path: Path) -> None:
    rig = GatewayRig(tmp_path)
    before = rig.run(10)["AliveCounter"]
    reload(rig)
    assert rig.run(1)["AliveCounter"] == before + 1


def test_our_heartbeat_goes_on_without_a_boot_up(canopen: CanopenRig) -> None:
    key = 0x700 + OURS

    def next_beat() -> tuple[int, bytes]:
        while not (beats := [f.data for f in canopen.sent if f.can_id == key]):
            canopen.run()
        canopen.sent = []
        return canopen.now_ns, beats[0]

    canopen.sent = []
    before_ns, _ = next_beat()
    canopen.run(3)
    reload(canopen)
    canopen.sent = []
    assert next_beat() == (before_ns + 200_000_000, bytes((OPERATIONAL,)))


def test_as_another_node_we_boot(canopen: CanopenRig) -> None:
    reload(canopen, ("node: 0x7E", "node: 0x7D"))
    canopen.tick()
    assert [f.data for f in canopen.sent if f.can_id == 0x77D] == [bytes((BOOT_UP,))]


def test_a_claimed_address_stays_claimed(j1939: J1939Rig) -> None:
    reload(j1939)
    for _ in range(20):
        sent = ids(j1939.tick(bjm("BJM1"), bjm("BJM2")))
        assert AVC | OWN in sent
        assert CLAIM not in sent


@pytest.mark.parametrize(
    "change", [("address: 0x9C", "address: 0x9D"), ("identity_number: ", "identity_number: 1")]
)
def test_another_address_or_name_is_claimed(j1939: J1939Rig, change: tuple[str, str]) -> None:
    reload(j1939, change)
    (claim,) = j1939.tick()
    assert claim.can_id & ~0xFF == CLAIM & ~0xFF
    assert j1939.reason() == "ADDRESS_NOT_CLAIMED"


def test_a_claim_that_waits_goes_on_waiting(tmp_path: Path) -> None:
    rig = J1939Rig()
    rig.run(5)
    reload(rig)
    sent = [ids(frames) for frames in rig.run(10)]
    assert CLAIM not in [one for tick in sent for one in tick]
    assert [AVC | OWN in tick for tick in sent] == [False] * 9 + [True]


def test_active_faults_go_on(j1939: J1939Rig) -> None:
    """How often they came too, and in their second."""

    def times(ticks: int) -> list[int]:
        """How often the one active fault came, by every DM1 of these ticks."""
        flows = [avef(number, 0.0) for number in range(3)]
        sent = [j1939.tick(bjm("BJM1"), bjm("BJM2"), *flows) for _ in range(ticks)]
        return [f.data[5] for frames in sent for f in frames if f.can_id == DM1]

    times(50)
    j1939.receive(Frame("crane", AVC & ~0xFF | OTHER, True, bytes(8)))
    assert times(20) == [1]
    reload(j1939)
    assert times(30) == []
    assert times(20) == [1]


# -- what others reported --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes",
    [
        (),
        (("heartbeat_ms: 500", "heartbeat_ms: 600"),),
        (("bus: crane", "bus: boom"), ("\n  crane:", "\n  boom:")),
        (("slew: { id: 0x20", "swing: { id: 0x20"), ("node: slew", "node: swing")),
    ],
)
def test_an_error_of_a_valve_is_still_there(
    canopen: CanopenRig, changes: tuple[tuple[str, str], ...]
) -> None:
    """Whatever its bus and its node are called, and where the bus was opened again too."""
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    canopen.run(5)
    reload(canopen, *changes)
    (canopen.bus,) = canopen.deployment.config.buses
    canopen.run(100)
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.axis("lift")[0] == "READY"
    canopen.emergency("slew", 0, register=0)
    canopen.until(lambda: canopen.axis()[0] == "READY")


def test_of_another_node_nothing_is_known(canopen: CanopenRig) -> None:
    canopen.emergency("slew", FLOW_COMMAND_LATE)
    reload(canopen, ("id: 0x20", "id: 0x2F"))
    for _ in range(30):
        canopen.receive(0x72F, bytes((OPERATIONAL,)))
        canopen.run()
    assert canopen.axis()[0] == "READY"


def test_a_heartbeat_is_as_old_as_it_was(canopen: CanopenRig) -> None:
    canopen.states["slew"] = -1
    canopen.run(10)
    reload(canopen)
    lost = next(n for n in range(100) if canopen.run() and "state=lost" in canopen.texts[-1])
    assert lost == 15  # 500 ms after the last one
    canopen.run()
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.last_fault == "HEARTBEAT_LOST"


def test_on_a_bus_that_was_opened_again_it_has_to_come_again(canopen: CanopenRig) -> None:
    canopen.states["slew"] = -1
    reload(canopen, ("bitrate: 250000", "bitrate: 500000"))
    canopen.run(30)
    assert canopen.axis() == ("NEUTRAL_WAIT", "NODE_FAULT")
    assert canopen.axis("lift")[0] == "READY"


def test_a_node_is_not_started_twice_as_often(canopen: CanopenRig) -> None:
    canopen.states["slew"] = PRE_OPERATIONAL
    canopen.run(1)
    assert canopen.commands
    reload(canopen)
    started = [bool(canopen.run(1) and canopen.commands) for _ in range(25)]
    assert started == [False] * 24 + [True]


def test_a_valve_is_brought_to_active_from_init(canopen: CanopenRig) -> None:
    """Also one that is active: what it does between two deployments is not known."""
    reload(canopen)
    assert canopen.run(1)["slew"]["ControlWord"] == 0x8
    canopen.until(lambda: canopen.axis()[0] == "READY")


def test_another_sender_that_no_tick_has_seen_trips(rig: Rig) -> None:
    """It is read after a tick sent its commands to the valves, and before the reload comes."""
    rig.run(3)
    rig.receive(FOREIGN)
    reload(rig)
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")
    rig.run(48)
    rig.run(1, Reset=1)
    assert rig.state() is State.TRIPPED
    rig.run(2)
    rig.run(1, Reset=1)
    rig.run(1)
    assert rig.state() is State.READY


def test_a_trip_that_no_tick_has_seen_is_one(rig: Rig) -> None:
    rig.moving()
    rig.controller.send_failed(FOREIGN)
    reload(rig)
    rig.run(1)
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SEND_FAILED")


def test_a_trip_stays_with_its_valve_whatever_the_axis_is_called(
    changed_rig: Make,
) -> None:
    rig = changed_rig()
    rig.run(3)
    rig.receive(FOREIGN)
    rig.run(2)
    reload(rig, ("  slew:\n", "  swing:\n"))
    rig.run(3)
    assert (rig.state("swing"), rig.reason("swing")) == (State.TRIPPED, "SECOND_SENDER")
    assert rig.state("lift") is State.READY


def test_a_valve_that_does_not_follow_is_still_reported(j1939: J1939Rig) -> None:
    for number in range(3):
        j1939.receive(avef(number, 0.0))
    j1939.run(1)
    j1939.receive(avef(0, 60.0))
    j1939.run(1)
    feedback = j1939.controller.axes["slew"].feedback
    assert feedback is not None
    assert feedback.following is Following.NO
    reload(j1939)
    j1939.events.clear()
    j1939.run(5)
    feedback = j1939.controller.axes["slew"].feedback
    assert feedback is not None
    assert feedback.following is Following.NO
    assert not [text for text in j1939.events if "valve=" in text]


def test_the_joystick_that_counted_still_does(j1939: J1939Rig) -> None:
    reload(j1939)
    j1939.events.clear()
    j1939.tick(bjm("BJM1", 0x34), bjm("BJM2"))
    assert j1939.fault == "SECOND_SENDER"
    assert "bus=crane message=BJM1 source=0x34 ignored, received=0x33" in j1939.events
    reload(j1939)
    j1939.events.clear()
    j1939.tick(bjm("BJM1", 0x34), bjm("BJM1"), bjm("BJM2"))
    assert not [text for text in j1939.events if "BJM1" in text]  # it has been reported
    assert j1939.state() is State.READY


# -- joysticks and the emergency stop --------------------------------------------------------------


@pytest.mark.parametrize("pressed", [1, 0])
def test_a_stop_that_is_pressed_is_so_for_a_new_axis_too(changed_rig: Make, pressed: int) -> None:
    """And one that is over is not, though it was pressed in the last tick before."""
    machine = Machine(changed_rig)
    machine.run(3)
    machine.rig.receive(machine.stop(1))
    machine.run(1, pressed)
    del machine.rig.controller.axes["lift"]
    reload(machine.rig)
    if pressed:
        machine.rig.run(1)
        assert machine.states() == PRESSED
    else:
        machine.run(2)
        assert machine.states() == [*PRESSED[:2], (State.READY, "JOYSTICK_NEUTRAL")]


def test_a_joysticks_sequence_goes_on(rig: Rig) -> None:
    """A repetition is no news, and a jump is one."""
    rig.run(3)
    last = rig.joystick()
    rig.receive(last)
    reload(rig)
    rig.receive(last)
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_REPEATED
    rig.counts["JoystickLeft"] += 4
    rig.receive(rig.joystick())
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_JUMP


def test_of_a_bus_that_was_opened_again_any_counter_but_the_last_is_the_next(
    changed_rig: Make,
) -> None:
    rig = changed_rig()
    rig.run(3)
    last = rig.joystick()
    rig.receive(last)
    reload(rig, ("bitrate: 250000", "bitrate: 500000"))
    rig.receive(last)
    assert rig.controller.counters.last_fault is FrameFault.COUNTER_REPEATED
    rig.counts["JoystickLeft"] += 4
    rig.run(1)
    assert rig.state() is State.READY


def test_an_enable_that_is_released_stays_so_until_a_frame_counts(rig: Rig) -> None:
    rig.run(3)
    rig.receive(rig.joystick(Enable=0))
    rig.tick()
    rig.counts["JoystickLeft"] += 9
    doubtful = rig.joystick(Enable=1)
    rig.receive(doubtful)
    reload(rig)
    rig.tick()
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "ENABLE_OFF")
    rig.run(1)
    assert rig.state() is State.READY


def test_late_ticks_before_it_count(rig: Rig) -> None:
    rig.run(3)
    for _ in range(10):
        rig.tick(missed=1)
    reload(rig)
    rig.run(3)
    assert (rig.state(), rig.reason()) == (State.NEUTRAL_WAIT, "LOOP_OVERRUN")
    rig.run(50)
    assert rig.state() is State.READY
