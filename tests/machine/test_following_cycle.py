"""A joystick that the ticks follow: its cycle fits into the tick, or the tick into it."""

import pytest

from tests.rigs.files import Machine

CYCLE = 'BA_ "GenMsgCycleTime" BO_ 272 20;'


def following(machine: Machine, cycle_ms: int) -> int:
    """Let the ticks follow the left joystick, which has this cycle; return the line."""
    machine.in_dbc(CYCLE, CYCLE.replace("272 20", f"272 {cycle_ms}"))
    return machine.in_yaml("tick_ms: 20", "tick: { follow: left }\ntick_ms: 20")


@pytest.mark.parametrize("cycle_ms", [4, 10, 20, 40])
def test_a_multiple_or_a_part_of_the_tick_is_followed(machine: Machine, cycle_ms: int) -> None:
    following(machine, cycle_ms)
    tick = machine.load().config.tick
    assert tick is not None
    assert tick.follow == "left"


@pytest.mark.parametrize(("cycle_ms", "got"), [(0, "none"), (8, "8 ms"), (30, "30 ms")])
def test_another_cycle_is_refused_with_what_it_is(
    machine: Machine, cycle_ms: int, got: str
) -> None:
    line = following(machine, cycle_ms)
    assert (
        f"machine.yaml:{line}: tick.follow: expected a GenMsgCycleTime that is a multiple or a part"
        f" of 20 ms, got {got}, that of left"
    ) in machine.problems()


def test_on_a_bus_whose_frames_have_no_stamp_none_is_followed(machine: Machine) -> None:
    line = following(machine, 20)
    socketcan = "interface: socketcan, channel: vcan0, bitrate: 250000"
    machine.in_yaml(socketcan, "interface: udp_multicast, channel: 239.1.2.3")
    assert (
        f"machine.yaml:{line}: tick.follow: expected a bus of socketcan, which stamps frames, got"
        " udp_multicast, the bus of left"
    ) in machine.problems()
