"""CRCs by their numbers: check values of the catalogue of parametrised CRC algorithms."""

import pickle
from collections.abc import Iterator

import pytest

from canshaper.checksums.algorithms import Crc8
from canshaper.checksums.kinds import CHECKSUMS, Checksum, checksum_names, crc_kind
from tests.rigs.files import Machine

DIGITS = b"123456789"
# Bits, polynomial, start, end, reflected, check value; names in the catalogue.
CATALOGUE = {
    "CRC-8/SMBUS": (8, 0x07, 0, 0, False, 0xF4),
    "CRC-8/I-432-1": (8, 0x07, 0, 0x55, False, 0xA1),
    "CRC-8/ROHC": (8, 0x07, 0xFF, 0, True, 0xD0),
    "CRC-8/OPENSAFETY": (8, 0x2F, 0, 0, False, 0x3E),
    "CRC-8/I-CODE": (8, 0x1D, 0xFD, 0, False, 0x7E),
    "CRC-8/NRSC-5": (8, 0x31, 0xFF, 0, False, 0xF7),
    "CRC-8/MAXIM-DOW": (8, 0x31, 0, 0, True, 0xA1),
    "CRC-8/DARC": (8, 0x39, 0, 0, True, 0x15),
    "CRC-8/CDMA2000": (8, 0x9B, 0xFF, 0, False, 0xDA),
    "CRC-8/WCDMA": (8, 0x9B, 0, 0, True, 0x25),
    "CRC-8/AUTOSAR": (8, 0x2F, 0xFF, 0xFF, False, 0xDF),
    "CRC-8/SAE-J1850": (8, 0x1D, 0xFF, 0xFF, False, 0x4B),
    "CRC-16/XMODEM": (16, 0x1021, 0, 0, False, 0x31C3),
    "CRC-16/GENIBUS": (16, 0x1021, 0xFFFF, 0xFFFF, False, 0xD64E),
    "CRC-16/KERMIT": (16, 0x1021, 0, 0, True, 0x2189),
    "CRC-16/IBM-SDLC": (16, 0x1021, 0xFFFF, 0xFFFF, True, 0x906E),
    "CRC-16/MODBUS": (16, 0x8005, 0xFFFF, 0, True, 0x4B37),
    "CRC-16/ARC": (16, 0x8005, 0, 0, True, 0xBB3D),
    "CRC-16/DNP": (16, 0x3D65, 0, 0xFFFF, True, 0xEA82),
    "CRC-16/OPENSAFETY-A": (16, 0x5935, 0, 0, False, 0x5D38),
}


@pytest.fixture(autouse=True)
def _as_before() -> Iterator[None]:
    """Take entries of a test out of the table with it."""
    before = dict(CHECKSUMS)
    yield
    CHECKSUMS.clear()
    CHECKSUMS.update(before)


@pytest.mark.parametrize("name", CATALOGUE)
def test_the_catalogue(name: str) -> None:
    bits, polynomial, start, end, reflected, value = CATALOGUE[name]
    kind = crc_kind(bits, polynomial, start, end, reflected=reflected)
    size = bits // 8
    protected = Checksum(kind, len(DIGITS), 0, "big").protect(DIGITS + bytes(size), 0)
    assert protected == DIGITS + value.to_bytes(size, "big")
    # Those of one byte the kernel computes too, from the same table.
    assert isinstance(CHECKSUMS[kind].kernel, Crc8) is (bits == 8)


def test_they_are_no_names_for_a_file() -> None:
    kind = crc_kind(8, 0x07, 0, 0, reflected=False)
    assert kind == CHECKSUMS[kind].text == "crc8 0x7 start 0x0 end 0x0"
    assert kind not in checksum_names()
    other = crc_kind(16, 0x1021, 0xFFFF, 0x1, reflected=True)
    assert other == CHECKSUMS[other].text == "crc16 0x1021 start 0xffff end 0x1 reflected"


@pytest.mark.parametrize(
    ("signal", "keys", "value"),
    [
        ("48|8@1+", "polynomial: 0x07", 0xF4),
        ("48|8@1+", "polynomial: 0x07, start: 0xFF, reflected: true", 0xD0),
        ("40|16@1+", "polynomial: 0x1021, start: 0xFFFF, end: 0xFFFF, reflected: true", 0x906E),
        ("47|16@0+", "polynomial: 0x1021", 0x31C3),
    ],
)
def test_in_a_deployment(machine: Machine, signal: str, keys: str, value: int) -> None:
    last = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    machine.in_dbc(last, f'{last} SG_ Check : {signal} (1,0) [0|255] "" SHAPER\n')
    checksum = f"checksum: {{ signal: Check, {keys} }}"
    machine.in_yaml("alive_counter: AliveCounter", f"alive_counter: AliveCounter\n    {checksum}")
    check = machine.load().joysticks["left"].protection.check
    assert isinstance(check, Checksum)
    bits = CHECKSUMS[check.kind].bits
    order = "big" if "@0" in signal else "little"
    frame = Checksum(check.kind, 9, 0, check.order).protect(DIGITS + bytes(bits // 8), 0)
    assert frame[9:] == value.to_bytes(bits // 8, order)
    protected = check.protect(bytes(range(8)), 0)
    assert check.verify(protected)
    assert not check.verify(bytes((protected[0] ^ 1, *protected[1:])))


def test_one_that_a_reload_brings_is_known_where_it_is_handed_over(machine: Machine) -> None:
    """The file is read in a process of its own, in whose table alone the row is then."""
    last = ' SG_ AliveCounter : 56|8@1+ (1,0) [0|255] "" SHAPER\n'
    machine.in_dbc(last, f'{last} SG_ Check : 40|16@1+ (1,0) [0|255] "" SHAPER\n')
    checksum = "checksum: { signal: Check, polynomial: 0x8BB7, start: 5, reflected: true }"
    machine.in_yaml("alive_counter: AliveCounter", f"alive_counter: AliveCounter\n    {checksum}")
    before = dict(CHECKSUMS)
    deployment = machine.load()
    check = deployment.joysticks["left"].protection.check
    assert isinstance(check, Checksum)
    frame = check.protect(bytes(range(8)), 0)
    handed_over = pickle.dumps(deployment)
    CHECKSUMS.clear()
    CHECKSUMS.update(before)
    after = pickle.loads(handed_over).joysticks["left"].protection.check
    assert after == check
    assert after.verify(frame)


def test_the_same_numbers_are_the_same_kind() -> None:
    name = crc_kind(8, 0x07, 0, 0x55, reflected=False)
    algorithm = CHECKSUMS[name].algorithm
    assert crc_kind(8, 0x07, 0, 0x55, reflected=False) == name
    assert CHECKSUMS[name].algorithm is algorithm
