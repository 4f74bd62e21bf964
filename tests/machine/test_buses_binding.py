"""Buses of a deployment: problems with their line, and what is just allowed."""

from pathlib import Path

import pytest

from canshaper.config.bus import LAST_SPN
from canshaper.machine.binding import load_deployment
from tests.rigs.files import Machine, faults, machine_file

BUS = "crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }"


def test_a_bus_of_multicast_may_be_shared(machine: Machine) -> None:
    machine.in_yaml(BUS, "crane: { interface: udp_multicast, channel: 239.1.1.1, network: true }")
    assert machine.load().config.buses["crane"].network


def test_an_option_of_socketcan_is_reported_of_its_bus(machine: Machine) -> None:
    line = machine.in_yaml(BUS, BUS.replace(" }", ", options: { retry: true } }"))
    assert machine.problems() == [
        f"machine.yaml:{line}: buses.crane.options: expected none with socketcan, which the system"
        " sets up, got some"
    ]


def test_a_data_bit_rate_may_be_the_bit_rate(machine: Machine) -> None:
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, data_bitrate: 250000, fd: true")
    assert machine.load().config.buses["crane"].data_bitrate == 250000


def j1939(folder: Path, first_spn: int) -> Path:
    """A machine of J1939 whose first axis has this number in DM1."""
    own = "    j1939:\n"
    return machine_file(folder, "j1939-forwarder", (own, f"{own}      first_spn: {first_spn}\n"))


def test_the_numbers_of_the_axes_end_at_the_last_one_of_j1939(tmp_path: Path) -> None:
    axes = len(load_deployment(j1939(tmp_path, 520192)).axes)
    first = LAST_SPN - 2 * axes + 1
    assert load_deployment(j1939(tmp_path, first))
    assert faults(j1939(tmp_path, first + 1)) == [
        f"buses.crane.j1939.first_spn: expected the last SPN up to {LAST_SPN}, got {LAST_SPN + 1}"
        f" from {first + 1} on"
    ]


@pytest.mark.parametrize(
    ("channel", "got"), [('""', "''"), ("can-of-the-crane", "'can-of-the-crane'")]
)
def test_a_channel_that_is_no_name_of_an_interface(
    machine: Machine, channel: str, got: str
) -> None:
    line = machine.in_yaml("channel: vcan0", f"channel: {channel}")
    expected = "expected the name of an interface, 1 to 15 characters"
    assert machine.problems() == [
        f"machine.yaml:{line}: buses.crane.channel: {expected}, got {got}"
    ]
