"""A deployment that only listens: what may still be sent, and what no longer counts."""

from pathlib import Path

import pytest

from canshaper.codec.frame import Frame
from canshaper.controller.controller import Controller
from canshaper.machine.binding import load_deployment
from canshaper.protocols.canopen.network import ValveControl
from canshaper.shaping.states import State
from tests.rigs import canopen, j1939
from tests.rigs.files import ROOT, text_of
from tests.rigs.forwarder import Make, Rig


def sent(name: str) -> set[int]:
    deployment = load_deployment(ROOT / "config" / name).listening()
    ids = [deployment.routing.buses[bus] for bus in deployment.config.buses]
    return {can_id for one in ids for can_id, _ in one.sent | one.claims}


def ids_of(name: str, *messages: str) -> set[int]:
    deployment = load_deployment(ROOT / "config" / name)
    entries = [deployment.messages.find(message) for message in messages]
    return {one[1].frame_id for one in entries if not isinstance(one, str)}


def test_of_the_plain_machine_only_status_is_sent() -> None:
    names = ("SlewStatus", "NearFarStatus", "LiftStatus", "ShaperStatus", "ShaperIdentity")
    assert sent("forwarder.yaml") == ids_of("forwarder.yaml", *names)


def test_no_node_of_canopen_is_started_or_received() -> None:
    assert not sent("canopen-forwarder.yaml") & {0, 0x700 + canopen.OURS}


def test_j1939_keeps_its_address_for_the_status_and_for_nothing_else(tmp_path: Path) -> None:
    machine = ROOT / "config" / "j1939-forwarder.yaml"
    valves = {a.valve.message.key[1] for a in load_deployment(machine).axes.values()}
    listening = load_deployment(machine).listening()
    reported = [s for s in (listening.status, *(a.status for a in listening.axes.values())) if s]
    assert reported
    assert j1939.CLAIM in sent("j1939-forwarder.yaml")
    assert not sent("j1939-forwarder.yaml") & valves
    assert listening.routing.buses["crane"].sent_groups == set()
    lines = text_of(machine).splitlines()
    silent = tmp_path / "silent.yaml"
    status = ("status:", "identity:")
    silent.write_text("\n".join(line for line in lines if not line.strip().startswith(status)))
    without = load_deployment(silent).listening()
    assert (
        without.routing.buses["crane"].sent | without.routing.buses["crane"].claims == frozenset()
    )
    assert without.config.buses["crane"].j1939 is None


def listening_rig(rig: Rig) -> Rig:
    rig.deployment = rig.deployment.listening()
    rig.controller = Controller(rig.deployment)
    return rig


def test_it_computes_the_same_as_one_that_drives(changed_rig: Make) -> None:
    rig, driving = listening_rig(changed_rig()), changed_rig()
    for number in range(300):
        joystick = (0, 1000, -500)[number // 50 % 3]
        one, other = rig.run(Slew=joystick), driving.run(Slew=joystick)
        assert [f[""] for f in one.values()] == [f[""] for f in other.values()]


def test_commands_of_the_controller_that_drives_are_no_second_sender(rig: Rig) -> None:
    listening_rig(rig).moving()
    command = rig.messages["SlewCommand"]
    for number in range(20):
        data = command.encode({"Velocity": 50, "AliveCounter": number})
        rig.receive(Frame("crane", command.frame_id, False, data))
        rig.run(Slew=1000)
    assert rig.state() is State.ACTIVE
    assert sum(rig.controller.counters.values.values()) == 0


@pytest.mark.parametrize("axis", ["slew", "near_far", "lift"])
def test_valves_of_canopen_need_not_follow(axis: str) -> None:
    deployment = load_deployment(ROOT / "config" / "canopen-forwarder.yaml").listening()
    controller = Controller(deployment)
    assert controller.axes[axis].feedback is None
    assert not any(isinstance(one, ValveControl) for one in controller.inputs.values())


def guest() -> j1939.Rig:
    rig = j1939.Rig()
    rig.deployment = rig.deployment.listening()
    rig.controller = Controller(rig.deployment)
    return rig


def sent_ids(rig: j1939.Rig, ticks: int, **left: float) -> list[int]:
    return [i for sent in rig.run(ticks, **left) for i in j1939.ids(sent)]


def test_the_address_is_asked_for_before_it_is_claimed() -> None:
    rig = guest()
    assert sent_ids(rig, 1) == [j1939.WHO_HAS_IT]
    rig.receive(j1939.request(0xEE00))  # somebody else asks too
    assert sent_ids(rig, 12) == []
    assert sent_ids(rig, 1) == [j1939.CLAIM]
    assert sent_ids(rig, 12) == []
    ids = set(sent_ids(rig, 100, X=100.0))
    assert ids & {i for i, _ in rig.deployment.routing.buses["crane"].sent}  # status
    assert j1939.DM1 not in ids


@pytest.mark.parametrize("difference", [-1, 1])
@pytest.mark.parametrize("when", [1, 20, 100])
def test_the_node_that_has_the_address_keeps_it(difference: int, when: int) -> None:
    rig = guest()
    rig.run(when)
    rig.receive(rig.claim(difference))
    assert set(sent_ids(rig, 50)) <= {j1939.NO_CLAIM}
    assert sent_ids(rig, 50, X=100.0) == []
    assert rig.state() is State.ACTIVE  # it computes all the same, for the log


def test_after_an_outage_it_is_asked_for_again() -> None:
    rig = guest()
    rig.run(100)
    rig.controller.on_bus_off("crane")
    assert sent_ids(rig, 3)[0] == j1939.WHO_HAS_IT
    rig.receive(rig.claim(1))
    assert set(sent_ids(rig, 50)) <= {j1939.NO_CLAIM}


def test_no_fault_is_reported_and_no_request_refused() -> None:
    rig = guest()
    rig.run(100)
    rig.receive(j1939.request(0xFECA), j1939.request(0xFEDA, to=j1939.OWN))
    ids = {i for _ in range(100) for i in j1939.ids(rig.tick())}  # the joysticks are silent
    assert not ids & {j1939.DM1, j1939.BROADCAST, j1939.NACK, 0x18E8FF9C}
