"""Which frames the gateway excludes: the exact words of their patterns."""

from pathlib import Path

import pytest

from canshaper.codec.frame import EFF_FLAG
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment
from canshaper.protocols.gateway.forwarding import Pattern
from canshaper.protocols.gateway.rules import excluded
from tests.machine.gateway_files import j1939_gateway, load
from tests.rigs.files import ROOT

J1939_DBC = ROOT / "dbc" / "j1939-bjm-avc.dbc"
ONE_ID_OF_11_BITS, ONE_ID_OF_29_BITS = 0x800007FF, 0x9FFFFFFF
GROUP_OF_ONE_SOURCE, GROUP_OF_ANY_SOURCE = 0x83FFFFFF, 0x83FFFF00
BJM1, BJM2, AVC0, AVEF0 = 0x80FDD600, 0x80FDD800, 0x80FE3000, 0x80FE1000
SLEW_STATUS, OWN = 2566856958, 0x9C


def changed_dbc(folder: Path, *changes: tuple[str, str]) -> Path:
    """The DBC file of J1939 with pieces replaced."""
    text = J1939_DBC.read_text("cp1252")
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    file = folder / "machine.dbc"
    file.write_text(text, "cp1252")
    return file


def in_line(folder: Path, *dbc: tuple[str, str]) -> Deployment:
    """The shipped machine of J1939 with a second bus behind a gateway."""
    text = (ROOT / "config" / "j1939-forwarder.yaml").read_text()
    text = text.replace("../dbc/j1939-bjm-avc.dbc", str(changed_dbc(folder, *dbc))).replace(
        "\ndbc:", "  far: { interface: socketcan, channel: can1 }\n"
        "gateway: { between: [crane, far], fallback: stop }\ndbc:", 1
    )  # fmt: skip
    file = folder / "machine.yaml"
    file.write_text(text)
    return load_deployment(file)


def test_a_joystick_of_11_bits_is_excluded_by_its_id(tmp_path: Path) -> None:
    ours = {0x110, 0x111, 0x300, 0x301, 0x302, 0x310, 0x311}
    assert excluded(load(tmp_path)) == {Pattern(i, ONE_ID_OF_11_BITS) for i in ours}


def test_a_joystick_of_any_source_is_excluded_from_all_of_them(tmp_path: Path) -> None:
    wide = {p for p in excluded(in_line(tmp_path)) if p.mask == GROUP_OF_ANY_SOURCE}
    assert wide == {Pattern(BJM1, GROUP_OF_ANY_SOURCE), Pattern(BJM2, GROUP_OF_ANY_SOURCE)}


def test_a_joystick_of_a_known_source_is_excluded_from_that_one_only(tmp_path: Path) -> None:
    """On one bus it is received, on the other one it is sent: it is the same pattern."""
    deployment = load_deployment(j1939_gateway(tmp_path, source="source: 0x33,"))
    assert excluded(deployment) == {Pattern(BJM1 | 0x33, GROUP_OF_ONE_SOURCE)}


def test_a_message_of_29_bits_without_j1939_is_excluded_at_its_priority_only(
    tmp_path: Path,
) -> None:
    can_id = 0x18FF0300
    load(tmp_path)
    dbc = tmp_path / "machine.dbc"
    dbc.write_text(dbc.read_text("cp1252").replace("BO_ 768 ", f"BO_ {can_id | EFF_FLAG} "))
    deployment = load_deployment(tmp_path / "machine.yaml")
    wide = {p for p in excluded(deployment) if p.value & EFF_FLAG}
    assert wide == {Pattern(can_id | EFF_FLAG, ONE_ID_OF_29_BITS)}


def test_on_a_bus_of_j1939_a_message_of_29_bits_is_excluded_at_every_priority(
    tmp_path: Path,
) -> None:
    assert Pattern(AVC0 | OWN, GROUP_OF_ONE_SOURCE) in excluded(in_line(tmp_path))


def test_on_a_bus_of_j1939_a_message_of_11_bits_is_excluded_by_its_id(tmp_path: Path) -> None:
    of_11_bits = (f'BA_ "VFrameFormat" BO_ {SLEW_STATUS} 3;', 'BA_ "VFrameFormat" BO_ 768 0;')
    deployment = in_line(tmp_path, of_11_bits, (str(SLEW_STATUS), "768"))
    narrow = {p for p in excluded(deployment) if not p.value & EFF_FLAG}
    assert narrow == {Pattern(0x300, ONE_ID_OF_11_BITS)}


@pytest.mark.parametrize(
    ("source", "pattern"),
    [
        (0x52, Pattern(AVEF0 | 0x52, GROUP_OF_ONE_SOURCE)),
        (0xFD, Pattern(AVEF0 | 0xFD, GROUP_OF_ONE_SOURCE)),
        (0xFE, Pattern(AVEF0, GROUP_OF_ANY_SOURCE)),
    ],
)
def test_what_is_blocked_is_blocked_from_the_source_that_the_dbc_names(
    tmp_path: Path, source: int, pattern: Pattern
) -> None:
    avef0 = EFF_FLAG | 0x0CFE1000
    dbc = changed_dbc(tmp_path, (str(avef0 | 0xFE), str(avef0 | source)))
    file = j1939_gateway(tmp_path, source="source: 0x33,")
    text = file.read_text().replace(str(J1939_DBC), str(dbc))
    file.write_text(text.replace("fallback: neutral", "fallback: neutral, blocked: [AVEF0]"))
    joystick = Pattern(BJM1 | 0x33, GROUP_OF_ONE_SOURCE)
    assert excluded(load_deployment(file)) == {joystick, pattern}
