"""Load of a bus by its messages, next to the table of frame times and a hand-made bit stuffing."""

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.machine.buses import longest_fd_bits, longest_frame_bits
from tests.rigs.files import Machine


# us at 250 kbit/s and 1 Mbit/s, 8 bytes: 11-bit id 540 and 135, 29-bit id 640 and 160.
@pytest.mark.parametrize(("extended", "bits"), [(False, 135), (True, 160)])
def test_longest_frames_of_eight_bytes(extended: bool, bits: int) -> None:
    assert longest_frame_bits(extended, 8) == bits


@pytest.mark.parametrize(("extended", "stuffed", "other"), [(False, 34, 13), (True, 54, 13)])
@pytest.mark.parametrize("length", range(9))
def test_stuff_bits_are_as_many_as_a_worst_frame_has(
    extended: bool, stuffed: int, other: int, length: int
) -> None:
    """Start to CRC is stuffed; after five equal bits one is put in, which begins the next run."""
    bits = [0] * 5
    while len(bits) < stuffed + 8 * length:
        bits += [1 - bits[-1]] * 4
    stuff = run = 0
    last: int | None = None
    for bit in bits[: stuffed + 8 * length]:
        run, last = (run + 1, bit) if bit == last else (1, bit)
        if run == 5:
            stuff, run, last = stuff + 1, 1, 1 - bit
    assert longest_frame_bits(extended, length) == stuffed + 8 * length + stuff + other


# CRC of 17 bits up to 16 bytes, else of 21; six or seven fixed stuff bits among it and its count.
@pytest.mark.parametrize(
    ("extended", "length", "slow", "fast"),
    [
        (False, 8, 17 + 4 + 13, 69 + 17 + 27),
        (False, 16, 17 + 4 + 13, 133 + 33 + 27),
        (False, 17, 17 + 4 + 13, 141 + 35 + 32),
        (False, 20, 17 + 4 + 13, 165 + 41 + 32),
        (True, 64, 36 + 8 + 13, 517 + 130 + 32),
    ],
)
def test_longest_frames_of_can_fd(extended: bool, length: int, slow: int, fast: int) -> None:
    assert longest_fd_bits(extended, length) == (slow, fast)


def test_the_data_of_can_fd_have_a_rate_of_their_own(machine: Machine) -> None:
    machine.in_dbc("SlewCommand: 2", "SlewCommand: 64")
    machine.in_yaml("bitrate: 250000", "bitrate: 250000, fd: true")
    slow = machine.load().load("crane")
    machine.in_yaml("fd: true", "fd: true, data_bitrate: 1000000")
    fast = machine.load().load("crane")
    assert slow is not None
    assert fast is not None
    data = longest_fd_bits(False, 64)[1] * 50
    assert slow.share - fast.share == pytest.approx(data / 250_000 - data / 1_000_000)
    check = ["check", str(machine.directory / "machine.yaml")]
    assert "% of 250 kbit/s, data 1000 kbit/s" in CliRunner().invoke(app, check).output


def test_every_message_of_the_deployment_counts_and_no_other(machine: Machine) -> None:
    deployment = machine.load()
    load = deployment.load("crane")
    assert load is not None
    used = ("Joystick", "Command", "Status", "Identity")
    cycles = [
        (m.length, m.cycle_time)
        for m in deployment.messages.all()
        if m.cycle_time and any(word in m.name for word in used)
    ]
    assert load.messages == len(cycles) == 10
    bits = sum(longest_frame_bits(False, n) * 1000 / ms for n, ms in cycles)
    assert load.share == pytest.approx(bits / 250_000)


def test_of_two_buses_each_has_its_own_messages(machine: Machine) -> None:
    machine.in_yaml(
        "  crane: {", "  valves: { interface: virtual, channel: v, bitrate: 125000 }\n  crane: {"
    )
    machine.yaml = machine.yaml.replace("valve: { bus: crane", "valve: { bus: valves")
    load = machine.load().load("valves")
    assert load is not None
    assert load.messages == 3
    assert load.share == pytest.approx(3 * 50 * longest_frame_bits(False, 2) / 125_000)


def test_check_reports_it_and_warns(machine: Machine) -> None:
    check = ["check", str(machine.directory / "machine.yaml")]
    machine.load()
    reported = CliRunner().invoke(app, check)
    assert reported.exit_code == 0
    assert "% of 250 kbit/s" in reported.output
    assert "WARNING: above" not in reported.output
    machine.in_yaml("bitrate: 250000", "bitrate: 40000")
    machine.load()
    reported = CliRunner().invoke(app, check)
    assert reported.exit_code == 0
    assert "WARNING: above 50 %" in reported.output
    machine.in_yaml(", bitrate: 40000", "")
    machine.load()
    assert "load is not known" in CliRunner().invoke(app, check).output


@pytest.mark.parametrize(("timeout", "fits"), [(60, True), (59, False)])
def test_a_valve_hears_three_frames_within_its_timeout(
    machine: Machine, timeout: int, fits: bool
) -> None:
    machine.yaml = machine.yaml.replace(
        "Velocity, timeout_ms: 200", f"Velocity, timeout_ms: {timeout}"
    )
    if fits:
        machine.load()
        return
    problems = machine.problems()
    assert len(problems) == 3
    assert (
        "axes.slew.valve.timeout_ms: expected 60 ms or more, three cycles of SlewCommand, so that"
        " two"
        " lost frames do not close it, got 59" in problems[0]
    )


def test_a_valve_without_timeout_is_refused(machine: Machine) -> None:
    machine.in_yaml("signal: Velocity, timeout_ms: 200", "signal: Velocity")
    assert "axes.slew.valve.timeout_ms: missing: silence after which" in machine.problems()[0]
