"""A reload carries over every counter, addresses and active faults."""

from pathlib import Path

import pytest

from canshaper.codec.e2e import COUNTER, E2e
from canshaper.codec.frame import Frame
from canshaper.codec.message import SentMessage
from canshaper.controller.controller import Controller
from canshaper.machine.deployment import Deployment
from canshaper.protocols.j1939.network import J1939Network
from tests.controller.reloaded import reload
from tests.machine.protected_machine import load
from tests.rigs.canopen import BOOT_UP, OPERATIONAL, OURS, CanopenRig
from tests.rigs.forwarder import TICK_NS, Rig
from tests.rigs.gateway import GatewayRig
from tests.rigs.j1939 import AVC, CLAIM, DM1, OTHER, OWN, avef, bjm, ids
from tests.rigs.j1939 import Rig as J1939Rig

Sent = dict[tuple[str, int, bool], bytes]


def last_of(frames: list[Frame]) -> Sent:
    return {frame[:3]: frame.data for frame in frames}


def count_of(message: SentMessage, data: bytes) -> int:
    """Alive counter of a frame of a message that has one."""
    protection = message.protection
    if isinstance(protection.check, E2e):
        return data[1] & COUNTER
    return int(message.fields.layout.decode(data)[protection.counter or ""])


def counts(deployment: Deployment, sent: Sent) -> dict[tuple[str, int, bool], int]:
    """Alive counter of every message that has one."""
    return {
        message.key: count_of(message, sent[message.key])
        for message in deployment.sent()
        if message.protection.counts
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


def test_on_a_bus_that_was_opened_again_it_is_claimed_again(j1939: J1939Rig) -> None:
    """Who has claimed it meanwhile was not seen."""
    reload(j1939, ("bitrate: 250000", "bitrate: 500000"))
    (claim,) = j1939.tick()
    assert claim.can_id == CLAIM | OWN
    assert j1939.reason() == "ADDRESS_NOT_CLAIMED"


def test_of_a_lost_address_a_reload_is_the_way_back(j1939: J1939Rig) -> None:
    j1939.tick(j1939.claim(-1))
    assert j1939.events[-1].endswith("state=lost")
    reload(j1939)
    assert ids(j1939.tick()) == [CLAIM | OWN]


def test_of_that_bus_alone_inputs_from_any_address_are_forgotten(
    j1939: J1939Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    forgotten: list[str | None] = []
    monkeypatch.setattr(J1939Network, "invalidate", lambda _, bus=None: forgotten.append(bus))
    reload(j1939)
    assert forgotten == []
    reload(j1939, ("bitrate: 250000", "bitrate: 500000"))
    assert forgotten == ["crane"]


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
