"""Protection of every message of a deployment: what is bound, and what a header may not say."""

from pathlib import Path

import pytest

from canshaper.checksums.kinds import Checksum
from canshaper.codec.e2e import E2e, Profile1, Profile2, Profile5
from canshaper.codec.message import Protection
from tests.machine.protected_machine import IDS, JOYSTICK, STOP, line_of, load, problems


def test_every_message_has_its_protection(tmp_path: Path) -> None:
    deployment = load(tmp_path)
    joystick = deployment.joysticks["hand"].protection
    assert (joystick.counter, joystick.counts) == (None, 15)
    assert isinstance(joystick.check, Profile1)
    slew, near_far = deployment.axes.values()
    assert slew.valve.message is near_far.valve.message
    valves = slew.valve.message.protection
    assert (valves.counts, type(valves.check)) == (16, Profile2)
    radius = deployment.motions["crane"].radius
    assert radius is not None
    assert isinstance(radius.protection.check, Profile1)
    assert deployment.emergency_stop is not None
    assert deployment.emergency_stop.protection.counts == 15
    assert deployment.status is not None
    assert deployment.status.message.protection == Protection(
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


@pytest.mark.parametrize(
    ("section", "e2e", "place", "says"),
    [
        (
            STOP,
            "{ profile: p05, data_id: 0x1234 }",
            "emergency_stop",
            "its header takes the first 24 bits of Stop, where Pressed lies, which is signal",
        ),
        (
            JOYSTICK,
            "{ profile: p04, data_id: 0x1234 }",
            "joysticks.hand",
            "Joystick: expected 12 bytes or more, got 8",
        ),
    ],
)
def test_the_header_fits_into_the_message_to_the_byte(
    tmp_path: Path, section: str, e2e: str, place: str, says: str
) -> None:
    line = line_of(f"e2e: {section}")
    assert problems(tmp_path, (section, e2e)) == [f"machine.yaml:{line}: {place}.e2e: {says}"]


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
            "data_id: 0x123",
            "data_id: 0x10000",
            ": data_id: expected up to 0xffff with profile p01, got 0x10000",
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
    ],
)
def test_what_a_header_may_not_say(tmp_path: Path, old: str, new: str, says: str) -> None:
    (problem,) = problems(tmp_path, (old, new))
    assert problem.startswith(f"machine.yaml:{line_of('e2e:')}: joysticks.hand.e2e")
    assert says in problem
