"""Messages of J1939 by their group: which joystick counts, who commands our valves."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.codec.frame import Frame
from canshaper.shaping.states import State
from tests.rigs.files import ROOT, machine_file
from tests.rigs.j1939 import AVC, JOYSTICK, OTHER, OWN, Rig, bjm, flow, ids

CONFIG = ROOT / "config" / "j1939-forwarder.yaml"


@pytest.fixture
def rig() -> Rig:
    return Rig()


def variant(directory: Path, *changes: tuple[str, str]) -> Rig:
    return Rig(machine_file(directory, CONFIG, *changes))


@pytest.mark.parametrize("priority", [0, 3, 6, 7])
def test_a_joystick_is_known_by_its_group_whatever_its_priority(rig: Rig, priority: int) -> None:
    for _ in range(30):
        rig.tick(bjm("BJM1", 0x35, priority), bjm("BJM2", 0x36, priority))
    assert rig.state() is State.READY
    assert "bus=crane message=BJM1 source=0x35" in rig.events


def test_the_first_of_two_joysticks_counts_and_the_other_is_named_once(rig: Rig) -> None:
    rig.moving()
    for _ in range(50):
        sent = rig.tick(bjm("BJM1", X=100.0), bjm("BJM1", 0x34, X=-100.0), bjm("BJM2"))
    assert flow(sent) > 50.0
    assert rig.fault == "SECOND_SENDER"
    named = [e for e in rig.events if "ignored" in e]
    assert named == ["bus=crane message=BJM1 source=0x34 ignored, received=0x33"]


def test_the_other_joystick_takes_over_after_silence_and_never_in_motion(rig: Rig) -> None:
    rig.moving()
    for _ in range(10):  # BJM1 has 100 ms; the other one was there all the time
        rig.tick(bjm("BJM1", 0x34, X=100.0), bjm("BJM2"))
    assert "bus=crane message=BJM1 source=0x34" in rig.events
    assert rig.state() is State.STOPPING
    for _ in range(200):
        sent = rig.tick(bjm("BJM1", 0x34, X=100.0), bjm("BJM2"))
    assert flow(sent) == 0.0
    assert rig.reason() == "JOYSTICK_NOT_NEUTRAL"  # it has to be seen in neutral first
    for x in (0.0, 100.0):
        for _ in range(40):
            sent = rig.tick(bjm("BJM1", 0x34, X=x), bjm("BJM2"))
    assert flow(sent) > 20.0


@pytest.mark.parametrize("gap", range(4, 9))
def test_a_change_of_joysticks_always_stops_however_the_ticks_fall(rig: Rig, gap: int) -> None:
    """Silence may begin and end between two looks at the input; the other is another one."""
    rig.moving()
    for _ in range(gap):
        rig.tick(bjm("BJM2"))
    began = rig.state()
    rig.tick(bjm("BJM1", 0x34, X=100.0), bjm("BJM2"))
    for _ in range(4):
        rig.tick(bjm("BJM1", 0x34, X=100.0), bjm("BJM2"))
    if f"source={0x34:#04x}" in " ".join(e for e in rig.events if "ignored" not in e):
        assert rig.state() in (State.STOPPING, State.NEUTRAL_WAIT)
    else:
        assert began is State.ACTIVE  # the first one still counted


@pytest.mark.parametrize("source", [OWN, 0xFE])
def test_a_second_joystick_without_an_address_of_its_own(rig: Rig, source: int) -> None:
    """Ours is no other node's, and FE is that of a node without one: what a DBC has for any."""
    rig.moving()
    sent = rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), bjm("BJM1", source, X=-100.0))
    assert rig.fault == "SECOND_SENDER"
    assert flow(sent) > 50.0


def test_no_one_else_may_use_our_address(rig: Rig) -> None:
    for _ in range(30):
        rig.tick(bjm("BJM1", OWN), bjm("BJM2"))
    assert rig.reason() == "JOYSTICK_TIMEOUT"


def test_a_joystick_of_one_address_and_no_other(tmp_path: Path) -> None:
    rig = variant(tmp_path, ("    message: BJM1\n", "    message: BJM1\n    source: 0x34\n"))
    for _ in range(20):
        rig.tick(bjm("BJM1"), bjm("BJM2"))
    assert rig.reason() == "JOYSTICK_TIMEOUT"
    assert rig.fault != "SECOND_SENDER"  # other traffic
    for _ in range(20):
        rig.tick(bjm("BJM1"), bjm("BJM1", 0x34, 6), bjm("BJM2"))
    assert rig.state() is State.READY


def test_two_joysticks_of_one_group_by_their_addresses(tmp_path: Path) -> None:
    rig = variant(
        tmp_path,
        ("    message: BJM1\n", "    message: BJM1\n    source: 0x34\n"),
        ("    message: BJM2\n", "    message: BJM1\n    source: 0x35\n"),
    )
    for _ in range(20):
        rig.tick(bjm("BJM1", 0x34), bjm("BJM1", 0x35))
    for _ in range(30):
        sent = rig.tick(bjm("BJM1", 0x34), bjm("BJM1", 0x35, Y=100.0))
    assert (flow(sent, 0), flow(sent, 1)) == (0.0, 0.0)
    assert flow(sent, 2) > 20.0


@pytest.mark.parametrize("priority", [3, 6])
@pytest.mark.parametrize("source", [OTHER, OWN, 0xFE])
def test_another_controller_that_commands_our_valve_trips_its_axis(
    rig: Rig, source: int, priority: int
) -> None:
    rig.moving()
    can_id = priority << 26 | AVC & 0x03FFFF00 | source
    foreign = Frame("crane", can_id, True, bytes.fromhex("96ff31ffffffffff"))
    sent = rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), foreign)
    assert flow(sent) == 0.0
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")
    assert rig.state("near_far") is State.READY
    assert rig.fault == "SECOND_SENDER"


def test_commands_to_valves_that_are_not_ours_are_other_traffic(rig: Rig) -> None:
    rig.moving()
    foreign = Frame("crane", AVC | 9 << 8 | OTHER, True, bytes(8))
    assert flow(rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), foreign)) > 50.0
    assert rig.fault == "FEEDBACK_LOST"


def test_valves_at_a_destination_conflict_at_that_one_only(tmp_path: Path) -> None:
    """PGN 50176, the general purpose valve command, says which valve it is for."""
    dbc = (ROOT / "dbc" / "j1939-bjm-avc.dbc").read_text(encoding="cp1252")
    addressed = 0x8CC480FE  # to 0x80
    changed = dbc.replace("2365468926", str(addressed))
    (tmp_path / "machine.dbc").write_text(changed, encoding="cp1252")
    rig = variant(tmp_path, (str(ROOT / "dbc" / "j1939-bjm-avc.dbc"), "machine.dbc"))
    rig.claimed().run(5)
    sent = rig.run(30, X=100.0)[-1]
    assert 0x0CC48000 | OWN in ids(sent)
    rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), Frame("crane", 0x0CC48121, True, bytes(8)))
    assert rig.state() is State.ACTIVE
    rig.tick(bjm("BJM1", X=100.0), bjm("BJM2"), Frame("crane", 0x0CC48021, True, bytes(8)))
    assert (rig.state(), rig.reason()) == (State.TRIPPED, "SECOND_SENDER")


@pytest.mark.parametrize("priority", [0, 3, 6, 7])
def test_a_joystick_with_a_destination_is_known_whatever_its_priority(
    tmp_path: Path, priority: int
) -> None:
    """Proprietary A from 0x33 to 0x27; the same group to another node is not for us."""
    dbc = (ROOT / "dbc" / "j1939-bjm-avc.dbc").read_text(encoding="cp1252")
    changed = dbc.replace("2365445886", str(0x8CEF2733))
    (tmp_path / "machine.dbc").write_text(changed, encoding="cp1252")
    rig = variant(tmp_path, (str(ROOT / "dbc" / "j1939-bjm-avc.dbc"), "machine.dbc"))
    data = bjm("BJM1").data
    for destination, state in ((0x28, State.NEUTRAL_WAIT), (0x27, State.READY)):
        can_id = priority << 26 | 0xEF0033 | destination << 8
        for _ in range(30):
            rig.tick(Frame("crane", can_id, True, data), bjm("BJM2"))
        assert rig.state() is state
    received = rig.deployment.routing.buses["crane"].received
    assert (can_id, True) in received  # or the kernel would keep it from us


def test_other_traffic_of_29_bits_is_no_fault_and_of_11_bits_it_is(rig: Rig) -> None:
    rig.claimed()
    before = rig.fault
    rig.tick(Frame("crane", 0x18FEEE00, True, bytes(8)), Frame("crane", 0x18ECFF33, True, bytes(8)))
    assert rig.fault == before
    rig.tick(Frame("crane", 0x123, False, bytes(8)))
    assert rig.fault == "UNKNOWN_ID"


def test_a_bus_that_is_only_listened_to_needs_no_address(tmp_path: Path) -> None:
    rig = variant(
        tmp_path,
        ("buses:\n", "buses:\n  joy: { interface: socketcan, channel: can7 }\n"),
        ("    bus: crane\n    message: BJM", "    bus: joy\n    message: BJM"),
    )
    joysticks = [frame._replace(bus="joy") for frame in (bjm("BJM1"), bjm("BJM2"))]
    for _ in range(20):
        rig.tick(*joysticks, Frame("joy", 0x18FEEE00, True, bytes(8)))
    assert rig.state() is State.READY
    assert rig.controller.counters.values["UnknownId"] == 0


def test_the_selected_joystick_is_received_after_an_outage_too(rig: Rig) -> None:
    rig.moving()
    for _ in range(200):
        rig.tick(bjm("BJM2"))
    rig.run(40)
    assert rig.state() is State.READY
    assert rig.events.count(f"bus=crane message=BJM1 source={JOYSTICK:#04x}") == 1


GROUPS = [0xEE00, 0xEA00, 0xFDD6, 0xFDD8, 0xFE30, 0xFE10, 0xFECA, 0xEC00, 0xEB00, 0xFEE5]
any_frame = st.builds(
    lambda priority, pgn, low, source, data: Frame(
        "crane", priority << 26 | (pgn | low if pgn < 0xF000 else pgn) << 8 | source, True, data
    ),
    st.integers(0, 7),
    st.sampled_from(GROUPS) | st.integers(0, 0x3FFFF),
    st.sampled_from([0, OWN, 0xFF]),
    st.sampled_from([OWN, OTHER, 0xFE, 0xFF]),
    st.binary(max_size=8),
)


@pytest.mark.slow
@given(st.lists(st.lists(any_frame, max_size=5), max_size=40))
def test_whatever_comes_we_speak_under_our_address_only_and_not_when_it_is_lost(
    ticks: list[list[Frame]],
) -> None:
    rig = Rig().claimed()
    lost = False
    for frames in ticks:
        sent = rig.tick(bjm("BJM1"), bjm("BJM2"), *frames)
        lost |= "bus=crane address=0x9c state=lost" in rig.events
        for frame in sent:
            assert len(frame.data) == 8
            assert frame.can_id & 0xFF == (0xFE if lost else OWN)
        if not lost:
            assert [flow(sent, n) for n in range(3)] == [0.0, 0.0, 0.0]
