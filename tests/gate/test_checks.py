"""Checksums and E2E of the gate: by catalogues, and the same as what the program sends."""

import random
from dataclasses import replace
from typing import Any

import pytest

from canshaper.checksums.kinds import CHECKSUMS, Checksum, crc_kind
from canshaper.codec.e2e import E2e, Profile1, Profile2, Profile4, Profile5, Profile6, Profile7
from canshaper.config.inputs import Protected
from canshaper.gate import checks
from canshaper.gate.build import record_of
from canshaper.gate.checks import crc_of
from canshaper.gate.record import Protection
from canshaper.gate.signals import protection_of
from tests.gate.bench import load
from tests.gate.test_decoder import message

DIGITS = b"123456789"
IDS = [*range(7, 23)]


@pytest.mark.parametrize(
    ("name", "value"),
    [("crc8_sae_j1850", 0x4B), ("crc8_autosar", 0xDF), ("p01", 0x37), ("crc16_ccitt_false", 0x29B1),
     ("crc16_arc", 0xBB3D), ("p04", 0x1697D06A), ("p07", 0x995DC9BBDF1939FA)],
)  # fmt: skip
def test_a_crc_has_the_value_of_the_catalogue(name: str, value: int) -> None:
    assert crc_of(name).of(DIGITS) == value


UNKNOWN = Protection(known=False)


def checksum_of(place: str, **keys: Any) -> Any:
    one = message(f"Check : {place}+ (1,0) [0|0]")
    section = Protected(bus="crane", message="Message", checksum={"signal": "Check", **keys})
    return protection_of(section, one, 0x1A2).check


@pytest.mark.parametrize("kind", [*CHECKSUMS, "polynomial"])
def test_every_kind_is_what_is_sent(kind: str) -> None:
    rng = random.Random(kind)
    keys: dict[str, Any] = {"kind": kind}
    bits = 8
    if kind == "polynomial":
        keys = {"polynomial": 0x1021, "start": 0x1D0F, "end": 7, "reflected": True}
        kind, bits = crc_kind(16, 0x1021, 0x1D0F, 7, reflected=True), 16
    elif kind in CHECKSUMS:
        bits = CHECKSUMS[kind].bits
    places = {4: ["16|4@1", "20|4@1"], 8: ["16|8@1", "7|8@0"], 16: ["16|16@1", "7|16@0"]}[bits]
    for place in places:
        check = checksum_of(place, **keys)
        at = 0 if place.startswith("7") else 2
        shift = 4 if place.startswith("20") else 0
        order: Any = "big" if place == "7|16@0" else "little"
        sent = Checksum(kind, at, shift, order, 0x1A2)
        for _ in range(30):
            data = sent.protect(rng.randbytes(8), 0)
            assert check.right(data)
            assert not check.right(bytes([data[0], data[1] ^ 0x10, *data[2:]]))


def test_of_another_package_it_is_not_known() -> None:
    one = message("Check : 0|8@1+ (1,0) [0|0]")
    section = Protected(bus="crane", message="Message", checksum={"signal": "Check", "kind": "xor"})
    assert section.checksum is not None
    theirs = section.checksum.model_copy(update={"kind": "of another package"})
    section = section.model_copy(update={"checksum": theirs})
    assert protection_of(section, one, 0) == UNKNOWN
    record = record_of(load("forwarder"))
    assert record.unchecked == []
    messages = record.messages | {"left": replace(record.messages["left"], protection=UNKNOWN)}
    assert replace(record, messages=messages).unchecked == ["left"]
    switches = record_of(load("ecu-forwarder"))
    (name,) = (name for name in switches.messages if name not in switches.joysticks)
    messages = {name: replace(switches.messages[name], protection=UNKNOWN)}
    assert replace(switches, messages=messages).unchecked == ["switch seat and crane_mode"]
    key, valve = next((k, one) for k, one in record.valves.items() if one.axes == ("slew",))
    valves = record.valves | {key: replace(valve, protection=UNKNOWN)}
    assert replace(record, valves=valves).unchecked == ["the valve of slew"]


PROFILES: dict[str, tuple[E2e, dict[str, Any]]] = {
    **{
        f"p01 {mode}": (Profile1(0xA5C, mode), {"data_id": 0xA5C, "data_id_mode": mode})
        for mode in ("both", "low", "alternating", "nibble")
    },
    "p11": (Profile1(0xA5C, "both"), {"data_id": 0xA5C, "data_id_mode": "both"}),
    "p02": (Profile2(IDS), {"data_ids": IDS}),
    "p22": (Profile2(IDS), {"data_ids": IDS}),
    "p04": (Profile4(0x0A0B0C0D), {"data_id": 0x0A0B0C0D}),
    "p05": (Profile5(0x1234), {"data_id": 0x1234}),
    "p06": (Profile6(0x1234), {"data_id": 0x1234}),
    "p07": (Profile7(0x0A0B0C0D), {"data_id": 0x0A0B0C0D}),
}


@pytest.mark.parametrize("name", PROFILES)
def test_every_profile_is_what_is_sent(name: str) -> None:
    sent, keys = PROFILES[name]
    section = Protected(bus="crane", message="Message", e2e={"profile": name[:3], **keys})
    protection = protection_of(section, None, 0)
    check, counts = protection.check, protection.counts
    assert protection == Protection(check, counts=sent.counts)
    rng = random.Random(name)
    for _ in range(40):
        count = rng.randrange(min(counts, 1000))
        data = sent.protect(rng.randbytes(24), count)
        assert check is not None
        assert check.right(data)
        assert protection.count(data, (0, 0)) == count
        for at in range(24):
            assert not check.right(data[:at] + bytes([data[at] ^ 0x10]) + data[at + 1 :])
    assert name[:3] not in ("p01", "p11") or not check.right(sent.protect(data, 15))  # type: ignore[union-attr]


@pytest.mark.parametrize("nibble", [0, 1, 2])
def test_the_nibble_of_a_data_id_is_in_the_frame(nibble: int) -> None:
    """Whatever the CRC says: that is right for each of them."""
    check = checks.E2e("p01", 15, 0x123, "nibble")
    rest = bytes([nibble << 4 | 5, *range(6)])
    assert check.right(bytes([check.crc.of(b"\x23\0" + rest)]) + rest) is (nibble == 1)


def test_a_frame_that_is_its_checksum_only() -> None:
    assert [checks.Checksum("xor", 0).right(bytes([one])) for one in (0, 1)] == [True, False]
