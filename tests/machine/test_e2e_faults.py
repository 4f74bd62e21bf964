"""Faults in the protection of messages: every problem with its line."""

from pathlib import Path

import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.message import Protection
from tests.machine.protected_machine import (
    JOYSTICK,
    RADIUS,
    STATUS,
    VALVES,
    line_of,
    load,
    problems,
)

HEADER = "its header takes the first 12 bits of"


@pytest.mark.parametrize(
    ("changes", "at", "says"),
    [
        # a field of the header that serves something else
        (
            [("enable: Enable", "enable: Seq")],
            "e2e:",
            f"joysticks.hand.e2e: {HEADER} Joystick, where Seq lies, which is enable",
        ),
        (
            [("enable: Enable", "enable: Top"), ("both", "nibble")],
            "e2e:",
            "joysticks.hand.e2e: its header takes the first 16 bits of Joystick, where Top lies",
        ),
        (
            [
                (
                    "signal: Slew }",
                    "signal: Crc, flags: { neutral: Top, negative: Seq, positive: Alive } }",
                )
            ],
            "joystick:",
            "axes.slew.command.signal: expected a free signal, got 'Crc', which is in the header"
            " of e2e already",
        ),
        (
            [("message: TipPosition", "message: Short")],
            f"e2e: {RADIUS}",
            "motion.crane.radius.e2e: Short: expected 2 bytes or more, got 1",
        ),
        (
            [(STATUS, STATUS.replace("alternating", "nibble"))],
            f"e2e: {STATUS}",
            "axes.slew.status.e2e: its header takes the first 16 bits of SlewStatus, where State"
            " lies, which is a signal of the status",
        ),
        # both kinds at once
        (
            [("qualify: 2", "alive_counter: Alive")],
            "qualify: 2",
            "joysticks.hand.alive_counter: expected one of alive_counter and e2e, got both",
        ),
        (
            [("qualify: 2", "checksum: { signal: Alive, kind: xor }")],
            "qualify: 2",
            "joysticks.hand.checksum: expected one of checksum and e2e, got both",
        ),
        # the counter of the header
        (
            [("qualify: 2", "alive_max_step: 8")],
            "qualify: 2",
            "joysticks.hand.alive_max_step: expected up to 7 with a counter of 15 values, got 8",
        ),
        # axes that share a message
        (
            [(f"e2e: {VALVES}", "alive_counter: Alive")],
            "",
            "expected the same as the other axes of Valves, got another",
        ),
        (
            [(f"e2e: {VALVES}", VALVES.replace("16, 17", "17, 16").join(("e2e: ", "")))],
            "",
            "axes.near_far.valve.e2e: expected the same as the other axes of Valves",
        ),
        # the other kind, of messages that are sent
        (
            [("alive_counter: Alive", "alive_counter: LastFault")],
            "alive_counter",
            "status.alive_counter: expected a free signal, got 'LastFault', which is a signal of"
            " the status already",
        ),
        (
            [("signal: Check", "signal: Reserve")],
            "checksum:",
            "status.checksum.signal: expected a signal of ShaperStatus, got 'Reserve'; there are"
            " LastFault,",
        ),
        (
            [("signal: Check", "signal: Alive")],
            "checksum:",
            "status.checksum.signal: expected a free signal, got 'Alive', which is alive_counter"
            " already",
        ),
        (
            [("signal: Check", "signal: UnknownId")],
            "checksum:",
            "status.checksum.signal: expected a free signal, got 'UnknownId', which is a signal of"
            " the status already",
        ),
        (
            [("alive_counter: Alive", "alive_max_step: 2")],
            "alive_counter",
            "status.alive_max_step: expected one of the keys bus, message, alive_counter,",
        ),
    ],
)
def test_one_fault_is_reported_with_its_line(
    tmp_path: Path, changes: list[tuple[str, str]], at: str, says: str
) -> None:
    reported = problems(tmp_path, *changes)
    start = f"machine.yaml:{line_of(at)}: " if at else "machine.yaml:"
    assert any(p.startswith(start) and says in p for p in reported), reported


@pytest.mark.parametrize(("message", "overlaps"), [("Half", True), ("Big", True), ("Apart", False)])
def test_one_bit_of_a_signal_in_the_header_is_too_many(
    tmp_path: Path, message: str, overlaps: bool
) -> None:
    """In either byte order."""
    reported = problems(tmp_path, ("message: TipPosition", f"message: {message}"))
    where = f"machine.yaml:{line_of(f'e2e: {RADIUS}')}: motion.crane.radius.e2e: "
    says = f"{HEADER} {message}, where Radius lies, which is signal"
    assert reported == ([where + says] if overlaps else [])


@pytest.mark.parametrize(
    ("protection", "says"),
    [
        (
            "checksum: { signal: Slew, kind: xor }",
            "signal: expected a free signal, got 'Slew', which is checksum already",
        ),
        (
            "alive_counter: NearFar",
            "alive_counter: NearFar: expected an unsigned integer signal, got a signed one",
        ),
        ("checksum: { signal: Low, kind: xor }", "Low: expected an unsigned byte of its own, got"),
        (
            f"e2e: {JOYSTICK.replace('both', 'nibble')}\n"
            "      direction: { signal: Low, neutral: 0, positive: 1, negative: 2 }",
            "direction.signal: expected a free signal, got 'Low', which is in the header of e2e"
            " already",
        ),
    ],
)
def test_a_valve_message_whose_protection_is_in_the_way(
    tmp_path: Path, protection: str, says: str
) -> None:
    old = f"e2e: {VALVES}"
    reported = problems(tmp_path, (old, protection), (old, protection))
    assert any(says in p for p in reported), reported


def test_a_counter_and_checksum_on_a_shared_valve_message(tmp_path: Path) -> None:
    old, new = (
        f"e2e: {VALVES}",
        "alive_counter: Alive\n      checksum: { signal: Check, kind: sum }",
    )
    axes = load(tmp_path, (old, new), (old, new)).axes
    message = axes["slew"].valve.message
    assert message.protection == Protection("Alive", 32, Checksum("sum", 5))
    counts, sender = [], message.sender()
    for _ in range(40):
        data = sender.frame().data
        counts.append(data[4] & 0x1F)
        assert data[5] == sum(data[:5]) & 0xFF
    assert counts == [(n + 1) % 32 for n in range(40)]
