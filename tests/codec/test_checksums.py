"""Every row of the table of checksums: published values, and each place that one may have."""

import pickle
import re
from hashlib import sha256
from importlib.metadata import EntryPoint, entry_points, version
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canshaper.checksums import kinds as module
from canshaper.checksums.algorithms import AUTOSAR, KernelSum, Xor
from canshaper.checksums.kinds import (
    CHECKSUMS,
    Checksum,
    ChecksumKind,
    checksum_names,
    known_checksum,
    package_line,
)
from canshaper.cli.verbs.config_schema import checksum_table
from canshaper.machine.identity import Identity
from tests.codec.checksum_reference import REFERENCE
from tests.rigs.files import ROOT

# Over the digits 1 to 9, id 0, the checksum behind them. Of the CRCs the check value in the
# catalogue of parametrised CRC algorithms; all others by hand.
DIGITS = b"123456789"
VALUES = {
    "xor": 0x31,
    "sum": 0xDD,
    "crc8_sae_j1850": 0x4B,
    "crc8_autosar": 0xDF,
    "sum_id": 0xDD,
    "sum_length": 0xDD + 10,
    "sum4": (9 * 3 + 45) % 16,
    "crc16_ccitt_false": 0x29B1,
    "crc16_arc": 0xBB3D,
}
BODY = bytes(range(0x11, 0x19))
ROWS = frozenset(CHECKSUMS)  # before any test has added a CRC by its numbers


def places(kind: str) -> list[Checksum]:
    """Where it may lie in eight bytes."""
    bits = CHECKSUMS[kind].bits
    if bits == 4:
        return [Checksum(kind, byte, shift) for byte in range(8) for shift in (0, 4)]
    if bits == 8:
        return [Checksum(kind, byte) for byte in range(8)]
    return [Checksum(kind, byte, 0, order) for byte in range(7) for order in ("little", "big")]


ALL = [pytest.param(place, id=f"{k}-{i}") for k in CHECKSUMS for i, place in enumerate(places(k))]


def mask(place: Checksum) -> int:
    """Its bits, byte 0 the lowest."""
    return (1 << CHECKSUMS[place.kind].bits) - 1 << 8 * place.byte + place.shift


def test_every_row_has_a_value_and_a_reference() -> None:
    assert VALUES.keys() == REFERENCE.keys() == ROWS


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_published_check_values(kind: str) -> None:
    size = (CHECKSUMS[kind].bits + 7) // 8
    little, big = (
        Checksum(kind, len(DIGITS), 0, order).protect(DIGITS + bytes(size), 0)
        for order in ("little", "big")
    )
    value = VALUES[kind]
    length = len(DIGITS) + size
    assert value == REFERENCE[kind](0, DIGITS, length)
    assert little == DIGITS + value.to_bytes(size, "little")
    assert big == DIGITS + value.to_bytes(size, "big")


@pytest.mark.parametrize("kind", CHECKSUMS)
@given(data=st.binary(min_size=8, max_size=8), can_id=st.integers(0, 0x1FFFFFFF), at=st.data())
def test_a_frame_is_sealed_as_by_the_reference(
    kind: str, data: bytes, can_id: int, at: st.DataObject
) -> None:
    """The other bits stay, and what lay in its own counts for nothing."""
    place = at.draw(st.sampled_from(places(kind)))
    place = Checksum(kind, place.byte, place.shift, place.order, can_id)
    protected = place.protect(data, 0)
    word, own = int.from_bytes(data, "little"), mask(place)
    assert int.from_bytes(protected, "little") & ~own == word & ~own
    clear = (word & ~own).to_bytes(8, "little")
    rest = place.others(data) if CHECKSUMS[kind].bits > 4 else clear
    size = (CHECKSUMS[kind].bits + 7) // 8
    value = int.from_bytes(protected[place.byte : place.byte + size], place.order) >> place.shift
    assert value & (1 << CHECKSUMS[kind].bits) - 1 == REFERENCE[kind](can_id, rest, 8)
    assert place.verify(protected)


@pytest.mark.parametrize("place", ALL)
def test_every_bit_of_a_frame_is_covered(place: Checksum) -> None:
    frame = place.protect(BODY, 0)
    assert place.verify(frame)
    for bit in range(64):
        wrong = (int.from_bytes(frame, "little") ^ 1 << bit).to_bytes(8, "little")
        assert not place.verify(wrong)
        own = mask(place) >> bit & 1
        assert (place.protect(wrong, 0) == frame) == bool(own)


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_a_frame_that_is_the_checksum_alone(kind: str) -> None:
    size = (CHECKSUMS[kind].bits + 7) // 8
    place = Checksum(kind, 0)
    frames = [value.to_bytes(size, "little") for value in range(256**size)]
    right = [frame for frame in frames if place.verify(frame)]
    # the upper half of a byte is no part of a checksum of four bits
    assert len(right) == (16 if CHECKSUMS[kind].bits == 4 else 1)


@pytest.mark.parametrize("kind", CHECKSUMS)
def test_whether_the_id_counts_is_what_the_row_says(kind: str) -> None:
    one, other = (Checksum(kind, 0, can_id=can_id) for can_id in (0x18FE4A03, 0x18FE4A04))
    assert (one.protect(BODY, 0) != other.protect(BODY, 0)) == CHECKSUMS[kind].needs_id
    assert one == other  # of two deployments: what decides is which message it is


def test_a_result_that_is_too_large_loses_its_upper_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    for bits, size in ((4, 1), (8, 1), (16, 2)):
        row = ChecksumKind("large", bits, lambda _id, _place, _data: 0x12345)
        monkeypatch.setitem(CHECKSUMS, "large", row)
        protected = Checksum("large", 1).protect(bytes(4), 0)
        assert protected == b"\0" + (0x12345 % (1 << bits)).to_bytes(size, "little") + bytes(
            3 - size
        )


# -- rows ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("bits", [0, 1, 7, 12, 24])
def test_no_other_width(bits: int) -> None:
    with pytest.raises(ValueError, match=f"^bits of a checksum: expected 4, 8 or 16, got {bits}$"):
        ChecksumKind("", bits, lambda _id, _place, _data: 0)


def test_the_kernel_knows_eight_bits_only() -> None:
    with pytest.raises(ValueError, match=r"^bits of a checksum of can-gw: expected 8, got 16$"):
        ChecksumKind("", 16, AUTOSAR)


def test_what_the_kernel_can_make() -> None:
    assert {k for k, row in CHECKSUMS.items() if row.kernel} == {
        "xor", "crc8_sae_j1850", "crc8_autosar",
    }  # fmt: skip
    with pytest.raises(NotImplementedError):
        KernelSum().of(b"")
    assert Xor().of(b"\1\2") == 3


# -- packages --------------------------------------------------------------------------------------

OWN = ChecksumKind("always 5", 8, lambda _id, _place, _data: 5)
NO_KIND = "no kind"


@pytest.fixture
def packages(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Declares entry points of packages; the table is as before afterwards."""
    monkeypatch.setattr(module, "CHECKSUMS", dict(CHECKSUMS))
    monkeypatch.setattr(module, "_SHA256", {})

    def declare(**entries: str) -> None:
        points = [EntryPoint(name, value, module.GROUP) for name, value in entries.items()]
        monkeypatch.setattr(module, "entry_points", lambda group: points)
        module._packages.cache_clear()

    yield declare
    module._packages.cache_clear()


def test_a_kind_of_a_package_joins_the_table_when_it_is_named(packages: Any) -> None:
    packages(always5=f"{__name__}:OWN", broken="no.such.module:kind")
    assert checksum_names() == [*VALUES, "always5", "broken"]
    assert "always5" not in module.CHECKSUMS
    assert known_checksum("always5") == known_checksum("always5") == "always5"
    assert module.CHECKSUMS["always5"] is OWN
    assert checksum_names() == [*VALUES, "always5", "broken"]


def test_it_joins_that_of_the_process_to_which_a_deployment_is_handed(packages: Any) -> None:
    packages(always5=f"{__name__}:OWN")
    handed_over = pickle.dumps(Checksum("always5", 0))
    assert "always5" not in module.CHECKSUMS
    assert pickle.loads(handed_over).protect(bytes(2), 0) == b"\5\0"


def test_what_runs_names_the_module_of_a_package(packages: Any) -> None:
    packages(always5=f"{__name__}:OWN")
    assert package_line("always5") is None  # not yet loaded
    known_checksum("always5")
    line = package_line("always5")
    assert line == (
        f"checksum=sha256:{sha256(Path(__file__).read_bytes()).hexdigest()} kind=always5"
        f" package={__name__}:OWN"
    )
    assert package_line("xor") is None
    with_it, other, without = (Identity("0", {}, lines) for lines in ((line,), ("-",), ()))
    assert len({with_it.digest, other.digest, without.digest}) == 3
    assert with_it.lines()[-1] == line


@pytest.mark.parametrize(
    ("kind", "entry", "text"),
    [
        (
            "xor",
            f"{__name__}:OWN",
            f"expected one package with the checksum 'xor', got canshaper and {__name__}:OWN",
        ),
        ("own", "no.such:kind", "cannot be loaded: ModuleNotFoundError: No module named 'no'"),
        ("own", f"{__name__}:NOT_THERE", "cannot be loaded: AttributeError: "),
        ("own", f"{__name__}:NO_KIND", f"{__name__}:NO_KIND: expected a ChecksumKind, got a str"),
        (
            "oven",
            f"{__name__}:OWN",
            "expected one of 'xor', 'sum', 'crc8_sae_j1850', ..., got 'oven'",
        ),
    ],
)
def test_what_is_wrong_with_a_package_is_one_line(
    packages: Any, kind: str, entry: str, text: str
) -> None:
    packages(**{"own" if kind == "oven" else kind: entry})
    with pytest.raises(ValueError, match=r"^(expected|'own' of the package) ") as caught:
        known_checksum(kind)
    assert all(part in str(caught.value) for part in text.split("..."))
    assert "\n" not in str(caught.value)
    assert known_checksum("sum") == "sum"  # the others are as good as ever


def test_the_package_is_named_with_its_version(monkeypatch: pytest.MonkeyPatch) -> None:
    """By an entry point of a package that is really installed, though it is none of a checksum."""
    (point,) = entry_points(group="console_scripts", name="pytest")
    monkeypatch.setattr(module, "_packages", lambda: {"pytest": [point]})
    text = f"'pytest' of the package pytest {version('pytest')}: expected a ChecksumKind"
    with pytest.raises(ValueError, match=f"^{re.escape(text)}"):
        known_checksum("pytest")


@pytest.mark.parametrize("kind", [8, None, ["xor"], True])
def test_what_is_no_name(kind: object) -> None:
    with pytest.raises(ValueError, match=r"^expected one of 'xor', .* or '.*', got "):
        known_checksum(kind)


def test_the_table_has_every_kind(packages: Any) -> None:
    packages(always5=f"{__name__}:OWN")
    *ours, its = checksum_table()
    assert "\n".join(ours) in (ROOT / "docs" / "checksums.md").read_text(encoding="utf-8")
    assert len(ours) == 2 + len(VALUES)
    assert ours[2] == "| `xor` | 8 | exclusive or of the bytes | yes |"
    assert its == "| `always5` | 8 | always 5 | no |"
