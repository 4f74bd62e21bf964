"""Protection of every message of a deployment: what is bound, and every problem with its line."""

from pathlib import Path

import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.e2e import E2e, Profile1, Profile2, Profile5
from canshaper.codec.protection import Protection
from tests.machine.protected_machine import (
    IDS,
    JOYSTICK,
    RADIUS,
    STATUS,
    STOP,
    VALVES,
    line_of,
    load,
    problems,
)

VALVE_OF = {
    "slew": "signal: Slew\n      timeout_ms",
    "near_far": "signal: NearFar\n      timeout_ms",
}


def test_every_message_has_its_protection(tmp_path: Path) -> None:
    deployment = load(tmp_path)
    joystick = deployment.joysticks["hand"].protection
    assert (joystick.counter, joystick.counts) == (None, 15)
    assert isinstance(joystick.check, Profile1)
    slew, near_far = deployment.axes.values()
    assert slew.valve.message is near_far.valve.message
    valves = slew.valve.message.sender.protection
    assert (valves.counts, type(valves.check)) == (16, Profile2)
    radius = deployment.motions["crane"].radius
    assert radius is not None
    assert isinstance(radius.protection.check, Profile1)
    assert deployment.emergency_stop is not None
    assert deployment.emergency_stop.protection.counts == 15
    assert deployment.status is not None
    assert deployment.status.sender.protection == Protection(
        "Alive", 8, Checksum("crc8_sae_j1850", 6)
    )


@pytest.mark.parametrize(
    ("section", "kind", "counts"),
    [
        ("{ profile: p11, data_id: 0x123, data_id_mode: nibble }", Profile1, 15),
        (f"{{ profile: p22, data_ids: {IDS} }}", Profile2, 16),
        ("{ profile: p05, data_id: 0x1234 }", Profile5, 256),
    ],
)
def test_other_profiles(tmp_path: Path, section: str, kind: type[E2e], counts: int) -> None:
    reported = problems(tmp_path, (STOP, section))
    # The stop lies in byte 2, where profile 5 has its counter.
    assert len(reported) == (kind is Profile5)
    if not reported:
        stop = load(tmp_path, (STOP, section)).emergency_stop
        assert stop
        assert (type(stop.protection.check), stop.protection.counts) == (kind, counts)


def test_what_the_header_does_not_take_may_be_used(tmp_path: Path) -> None:
    """The upper half of byte 1 is State in the status, and Low in the valve message."""
    assert not problems(tmp_path)
    assert not problems(tmp_path, ("enable: Enable", "enable: Top"))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        # the section itself
        (
            JOYSTICK,
            "{ profile: p03, data_id: 1 }",
            ".profile: expected 'p01', 'p02', 'p04', 'p05', 'p06', 'p07', 'p11' or 'p22', got"
            " 'p03'",
        ),
        (
            JOYSTICK,
            "{ profile: p05, data_id: 0x10000 }",
            ": data_id: expected up to 0xffff with profile p05, got 0x10000",
        ),
        (JOYSTICK, "{ data_id: 1 }", ".profile: missing: profile of AUTOSAR E2E"),
        (
            JOYSTICK,
            "{ profile: p01, data_id: 1 }",
            ": expected data_id and data_id_mode with profile p01, got data_id",
        ),
        (
            JOYSTICK,
            "{ profile: p05, data_id: 1, data_id_mode: low }",
            ": expected data_id with profile p05, got data_id and data_id_mode",
        ),
        (
            JOYSTICK,
            "{ profile: p11, data_id: 1, data_id_mode: low }",
            ": data_id_mode: expected both or nibble with profile p11, got low",
        ),
        (
            JOYSTICK,
            "{ profile: p01, data_id_mode: low }",
            ": expected data_id and data_id_mode with profile p01, got data_id_mode",
        ),
        (JOYSTICK, "{ profile: p02 }", ": expected data_ids with profile p02, got no data ID"),
        (
            JOYSTICK,
            "{ profile: p02, data_id: 1, data_id_mode: low }",
            ": expected data_ids with profile p02, got data_id and data_id_mode",
        ),
        (
            JOYSTICK,
            f"{{ profile: p01, data_id: 1, data_id_mode: low, data_ids: {IDS} }}",
            ": expected data_id and data_id_mode with profile p01, got data_id and data_id_mode"
            " and data_ids",
        ),
        (
            JOYSTICK,
            f"{{ profile: p02, data_ids: {IDS[:15]} }}",
            ".data_ids: expected 16 or more entries, got"
            " [16, 17, 18, 19, 20, 21, 22, 23, 24, 25, 26, 27, 28, 29, 30]",
        ),
        (
            JOYSTICK,
            f"{{ profile: p02, data_ids: {[*IDS, 1]} }}",
            ".data_ids: expected 16 entries at most, got [",
        ),
        (
            JOYSTICK,
            f"{{ profile: p02, data_ids: {[*IDS[:15], 256]} }}",
            ".data_ids.15: expected a whole number, 0 to 255, got 256",
        ),
        (
            "data_id: 0x123",
            "data_id: 0x10000",
            ": data_id: expected up to 0xffff with profile p01, got 0x10000",
        ),
        (
            "data_id: 0x123",
            "data_id: -1",
            ".data_id: expected a whole number, 0 to 4294967295, got -1",
        ),
        (
            "data_id_mode: both",
            "data_id_mode: high",
            ".data_id_mode: expected 'both', 'low', 'alternating' or 'nibble', got 'high'",
        ),
        (
            "0x123, data_id_mode: both",
            "0x1234, data_id_mode: nibble",
            ": data_id: expected up to 0xfff in mode nibble, got 0x1234",
        ),
        (
            "data_id_mode: both",
            "data_id_mode: both, offset: 8",
            ".offset: expected one of the keys profile, data_id, data_id_mode, data_ids",
        ),
    ],
)
def test_what_a_header_may_not_say(tmp_path: Path, old: str, new: str, says: str) -> None:
    (problem,) = problems(tmp_path, (old, new))
    assert problem.startswith(f"machine.yaml:{line_of('e2e:')}: joysticks.hand.e2e")
    assert says in problem


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
    assert message.sender.protection == Protection("Alive", 32, Checksum("sum", 5))
    counts = []
    for _ in range(40):
        data = message.frame().data
        counts.append(data[4] & 0x1F)
        assert data[5] == sum(data[:5]) & 0xFF
    assert counts == [(n + 1) % 32 for n in range(40)]
