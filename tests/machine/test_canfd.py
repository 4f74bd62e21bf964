"""Messages of CAN FD in a deployment: what `canshaper check` says, and how they are bound."""

from pathlib import Path

import pytest

from canshaper.codec.layout import FD_LENGTHS
from canshaper.machine.binding import load_deployment
from tests.machine.gateway_files import changed
from tests.rigs.files import ROOT, Machine, faults, machine_file
from tests.rigs.sent import command_frame

FD = 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","J1939PG","StandardCAN_FD";\n'
FD += 'BA_DEF_DEF_ "VFrameFormat" "StandardCAN";\n'


def test_the_messages_of_can_fd_are_known_by_their_bus() -> None:
    deployment = load_deployment(ROOT / "config" / "canfd-forwarder.yaml")
    fd = {0x120, 0x121, 0x210, 0x211, 0x212}
    assert deployment.fd == {("crane", can_id, False) for can_id in fd}
    assert deployment.routing.buses["crane"].fd == {(can_id, False) for can_id in fd}


def test_each_bus_has_its_own(machine: Machine) -> None:
    machine.in_yaml(
        "  crane: {", "  valves: { interface: virtual, channel: v, fd: true }\n  crane: {"
    )
    machine.yaml = machine.yaml.replace("valve: { bus: crane", "valve: { bus: valves")
    machine.in_dbc("SlewCommand: 2", "SlewCommand: 24")
    buses = machine.load().routing.buses
    assert (buses["crane"].fd, buses["valves"].fd) == (frozenset(), {(0x200, False)})


LENGTHS = [n for n in range(9, 65) if {n, n - 1} & {*FD_LENGTHS}]  # both sides of each step


@pytest.mark.parametrize("length", LENGTHS)
def test_a_message_fills_the_next_longer_frame(machine: Machine, length: int) -> None:
    """Bits of no signal are sent as 0, and received as anything."""
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, fd: true")
    machine.in_dbc("SlewCommand: 2", f"SlewCommand: {length}")
    machine.in_dbc("JoystickLeft: 8", f"JoystickLeft: {length}")
    deployment = machine.load()
    frame = command_frame(deployment.axes["slew"].valve)
    least = min(n for n in FD_LENGTHS if n >= length)
    assert len(frame.data) == least
    assert frame.data[2:] == bytes(least - 2)
    joystick = deployment.joysticks["left"]
    assert joystick.decode(bytes(8) + b"\xcc" * (least - 8))[0]["Slew"] == 0


@pytest.mark.parametrize(("length", "good"), [(12, True), (11, False)])
def test_a_checksum_covers_whole_frames(machine: Machine, length: int, good: bool) -> None:
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, fd: true")
    machine.in_dbc("SlewCommand: 2", f"SlewCommand: {length}")
    old = ' SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES\n'
    machine.in_dbc(old, f'{old} SG_ Check : 64|8@1+ (1,0) [0|255] "" VALVES\n')
    line = machine.in_yaml(
        "signal: Velocity,", "signal: Velocity, checksum: { signal: Check, kind: xor },"
    )
    if good:
        assert machine.load()
        return
    (problem,) = machine.problems()
    assert problem == (
        f"machine.yaml:{line}: axes.slew.valve.message: SlewCommand: expected the length of a frame"
        " with checksum or e2e, 12 bytes, got 11"
    )


@pytest.mark.parametrize("length", [2, 8])
def test_a_short_message_may_be_one_of_can_fd_by_its_dbc(machine: Machine, length: int) -> None:
    machine.in_dbc("SlewCommand: 2", f"SlewCommand: {length}")
    machine.in_dbc("BA_DEF_ BO_", f"{FD}BA_DEF_ BO_")
    machine.dbc += 'BA_ "VFrameFormat" BO_ 512 3;\n'
    (problem,) = machine.problems()
    assert problem.endswith(
        "axes.slew.valve.message: SlewCommand: expected a message of classical CAN, 8 bytes at"
        " most, got one of CAN FD: bus crane has no fd: true"
    )
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, fd: true")
    assert machine.load().routing.buses["crane"].fd == {(0x200, False)}


def test_no_frame_has_more_than_64_bytes(machine: Machine) -> None:
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, fd: true")
    machine.in_dbc("SlewCommand: 2", "SlewCommand: 65")
    (problem,) = machine.problems()
    assert problem.endswith(
        ": axes.slew.valve.message: SlewCommand: expected 64 bytes at most, got 65"
    )


@pytest.mark.parametrize(
    ("new", "where", "says"),
    [
        (
            "bitrate: 250000, data_bitrate: 2000000",
            "data_bitrate",
            "expected it with fd: true, got it without",
        ),
        (
            "bitrate: 250000, fd: true, data_bitrate: 125000",
            "data_bitrate",
            "expected the bitrate of the bus, 250000, or more, got 125000",
        ),
        (
            "fd: true, canopen: { node: 1 }",
            "fd",
            "expected none on a bus of canopen, whose frames are classical, got true",
        ),
    ],
)
def test_what_cannot_be_a_bus_of_can_fd(machine: Machine, new: str, where: str, says: str) -> None:
    line = machine.in_yaml("bitrate: 250000", new)
    (problem,) = machine.problems()
    assert problem == f"machine.yaml:{line}: buses.crane.{where}: {says}"


def test_j1939_is_classical(tmp_path: Path) -> None:
    file = machine_file(tmp_path, "j1939-forwarder", ("bitrate: 250000", "fd: true"))
    (fault,) = faults(file)
    assert "expected none on a bus of j1939" in fault


FD_MACHINE = ("channel: vcan1, bitrate: 250000", "channel: vcan1, bitrate: 250000, fd: true")
FD_JOYSTICKS = ("channel: vcan0, bitrate: 250000", "channel: vcan0, bitrate: 250000, fd: true")


def test_a_gateway_has_can_fd_on_both_sides_and_passes_it_itself(tmp_path: Path) -> None:
    one = changed(tmp_path, FD_MACHINE).faults()
    assert one == ["gateway.between: expected fd: true of both buses or of none, got it of one"]
    (problem,) = changed(tmp_path, FD_MACHINE, FD_JOYSTICKS).problems()
    assert problem.endswith(
        "gateway.forwarding: expected daemon with fd: true: our rules of can-gw pass classical"
        " frames only; got kernel"
    )
