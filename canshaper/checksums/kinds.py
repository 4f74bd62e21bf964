"""Checksums: one row for each kind, those of other packages too.

A row is all that there is of a kind. From it come the names that a deployment file may have, the
JSON schema, the table in docs/checksums.md, what is verified and what is sent, and what can-gw of
the kernel may send instead of us.
"""

import binascii
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Literal

from crccheck.crc import Crc8Base, Crc16Arc, Crc16Base, CrcBase

from canshaper.checksums.algorithms import AUTOSAR, SAE_J1850, Crc8, Crc16, ReflectedCrc, Xor

GROUP = "canshaper.checksums"
"""Entry points of packages: the name of a kind, and the ``ChecksumKind`` that it is."""


@dataclass(frozen=True, slots=True)
class Checksum:
    """The checksum of one message, as it is bound.

    Attributes:
        kind: its row in ``CHECKSUMS``.
        byte: where it begins.
        shift: its lowest bit in that byte: 4 in the upper half, else 0.
        order: of its bytes, where it has two.
        can_id: identifier of the message; two messages are never compared, only two deployments.
    """

    kind: str
    byte: int
    shift: int = 0
    order: Literal["little", "big"] = "little"
    can_id: int = field(default=0, compare=False)

    def __reduce__(self) -> tuple[Callable[..., "Checksum"], tuple[object, ...]]:
        """Pickled with what its row is made of: a reload reads it in a process of its own."""
        bound = (self.kind, self.byte, self.shift, self.order, self.can_id)
        return _handed_over, (_NUMBERS.get(self.kind), bound)

    def others(self, data: bytes) -> bytes:
        """The bytes of a frame in which no bit of it lies."""
        return data[: self.byte] + data[self.byte + (CHECKSUMS[self.kind].bits + 7) // 8 :]

    def verify(self, data: bytes) -> bool:
        """Whether a frame has the checksum that it should."""
        return self.protect(data, 0) == data

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its checksum; the counter is one of its signals."""
        row, first, order = CHECKSUMS[self.kind], self.byte, self.order
        bits = row.bits
        size = (bits + 7) // 8
        before, after = data[:first], data[first + size :]
        rest = data[first] & 0xF0 >> self.shift if bits == 4 else 0  # the other half of the byte
        clear = before + rest.to_bytes(size, order) + after
        value = row.algorithm(self.can_id, self, clear) & (1 << bits) - 1
        return before + (value << self.shift | rest).to_bytes(size, order) + after


Algorithm = Callable[[int, Checksum, bytes], int]
"""Checksum of a frame by its CAN id, the place of the checksum, and its data.

The bits of the checksum are 0 in the data. Of the result the lowest bits count. It runs in every
tick: it waits for nothing, keeps nothing and raises nothing.
"""


@dataclass(frozen=True, slots=True)
class ChecksumKind:
    """How a checksum is computed.

    Attributes:
        text: what it is, for people.
        bits: its width: 4, 8 or 16.
        algorithm: what computes it. An ``Xor`` or a ``Crc8`` computes it in the kernel too.
        needs_id: whether the CAN id counts: the sender of such a message has to be known.

    Raises:
        ValueError: another width, or one that the kernel computes and has not 8 bits.

    Examples:
        A package adds one by an entry point of the group ``canshaper.checksums`` that names it:

        >>> from canshaper import ChecksumKind, Xor
        >>> kind = ChecksumKind("exclusive or, start 0x55", 8, Xor(0x55))
        >>> hex(kind.algorithm.of(bytes([1, 2, 4])))
        '0x52'
        >>> kind.kernel is kind.algorithm  # can-gw computes it too
        True
    """

    text: str
    bits: int
    algorithm: Algorithm
    needs_id: bool = False

    def __post_init__(self) -> None:
        if self.bits not in (4, 8, 16):
            raise ValueError(f"bits of a checksum: expected 4, 8 or 16, got {self.bits}")
        if self.kernel and self.bits != 8:
            raise ValueError(f"bits of a checksum of can-gw: expected 8, got {self.bits}")

    @property
    def kernel(self) -> Xor | Crc8 | None:
        """Algorithm by which can-gw of the kernel computes the same; None where it cannot."""
        algorithm = self.algorithm
        return algorithm if isinstance(algorithm, Xor | Crc8) else None


CRC_WIDTHS: Mapping[int, type[CrcBase]] = {8: Crc8Base, 16: Crc16Base}
"""Bits that a CRC by its polynomial may have."""


def crc_kind(bits: int, polynomial: int, start: int, end: int, *, reflected: bool) -> str:
    """The name of a CRC by its numbers, which is in ``CHECKSUMS`` from now on.

    Args:
        bits: one of ``CRC_WIDTHS``.
        polynomial: without its highest bit.
        start: register before the first byte.
        end: what the register is changed by after the last.
        reflected: the lowest bit of each byte comes first, and of the register.
    """
    name = f"crc{bits} {polynomial:#x} start {start:#x} end {end:#x}{' reflected' * reflected}"
    if name not in CHECKSUMS:
        numbers = {
            "_poly": polynomial,
            "_initvalue": start,
            "_xor_output": end,
            "_reflect_input": reflected,
            "_reflect_output": reflected,
        }
        library = type("Crc", (CRC_WIDTHS[bits],), numbers)
        algorithm: Algorithm
        if issubclass(library, Crc8Base):
            algorithm = Crc8(library)
        else:
            algorithm = _of_others(ReflectedCrc(library) if reflected else Crc16(library))
        CHECKSUMS[name] = ChecksumKind(name, bits, algorithm)
        _NUMBERS[name] = bits, polynomial, start, end, reflected
    return name


def _handed_over(
    numbers: tuple[int, int, int, int, bool] | None,
    bound: tuple[str, int, int, Literal["little", "big"], int],
) -> Checksum:
    """A checksum of another process; its kind may be in the table of that one only."""
    if numbers is not None:
        crc_kind(*numbers[:4], reflected=numbers[4])
    elif bound[0] not in CHECKSUMS:
        known_checksum(bound[0])
    return Checksum(*bound)


def _of_others(crc: ReflectedCrc | Crc16) -> Algorithm:
    """A CRC over the bytes in which no bit of the checksum lies."""
    return lambda _can_id, place, data: crc.of(place.others(data))


def _nibbles(_can_id: int, _place: Checksum, data: bytes) -> int:
    return sum(data) + sum(byte >> 4 for byte in data)  # modulo 16 a byte is its lower half


def _sum_id(can_id: int, _place: Checksum, data: bytes) -> int:
    return sum(data) + sum(can_id.to_bytes(4, "little"))


def _ccitt_false(_can_id: int, place: Checksum, data: bytes) -> int:
    return binascii.crc_hqx(place.others(data), 0xFFFF)


CHECKSUMS: dict[str, ChecksumKind] = {
    "xor": ChecksumKind("exclusive or of the bytes", 8, Xor()),
    "sum": ChecksumKind("sum of the bytes", 8, lambda _id, _place, data: sum(data)),
    "crc8_sae_j1850": ChecksumKind("CRC 0x1D, start and end 0xFF", 8, SAE_J1850),
    "crc8_autosar": ChecksumKind("CRC 0x2F, start and end 0xFF (8H2F)", 8, AUTOSAR),
    "sum_id": ChecksumKind("sum of the bytes and of those of the CAN id", 8, _sum_id, True),
    "sum_length": ChecksumKind(
        "sum of the bytes and of their number, with that of the checksum",
        8,
        lambda _id, _place, data: sum(data) + len(data),
    ),
    "sum4": ChecksumKind("sum of the half bytes", 4, _nibbles),
    "crc16_ccitt_false": ChecksumKind("CRC 0x1021, start 0xFFFF (IBM 3740)", 16, _ccitt_false),
    "crc16_arc": ChecksumKind(
        "CRC 0x8005, reflected, start 0", 16, _of_others(ReflectedCrc(Crc16Arc))
    ),
}
"""Every kind by its name, over all bytes of a frame but its own. Those of packages join it when a
deployment names them."""

_OURS = frozenset(CHECKSUMS)
_NUMBERS: dict[str, tuple[int, int, int, int, bool]] = {}
"""Numbers from which ``crc_kind`` made a row, by its name."""
_SHA256: dict[str, str] = {}
"""SHA-256 of the modules that added a kind, by kind."""


def known_checksum(kind: object) -> str:
    """The name of a kind, which is in ``CHECKSUMS`` from now on.

    Raises:
        ValueError: there is no such kind, or two have the name, or its package cannot be loaded;
            one line for the person who wrote the deployment file.
    """
    name = kind if isinstance(kind, str) else ""
    entries = _packages().get(name, [])
    owners = [*["canshaper"] * (name in _OURS), *sorted(map(_owner, entries))]
    if len(owners) > 1:
        text = f"expected one package with the checksum {kind!r}"
        raise ValueError(f"{text}, got {' and '.join(owners)}")
    if entries and name not in CHECKSUMS:
        CHECKSUMS[name], _SHA256[name] = _loaded(entries[0])
    if name not in CHECKSUMS:
        *first, last = map(repr, checksum_names())
        raise ValueError(f"expected one of {', '.join(first)} or {last}, got {kind!r}")
    return name


def checksum_names() -> list[str]:
    """Names of all kinds, ours first; no package is loaded for it."""
    return list(dict.fromkeys([*(n for n in CHECKSUMS if n in _OURS), *_packages()]))


def package_line(kind: str) -> str | None:
    """Which package added a kind, with the SHA-256 of the module; None for one of ours."""
    if kind not in _SHA256:
        return None
    return f"checksum=sha256:{_SHA256[kind]} kind={kind} package={_owner(_packages()[kind][0])}"


@cache
def _packages() -> dict[str, list[EntryPoint]]:
    """Return the entry points of packages by name: read once, when a deployment has a checksum."""
    declared: dict[str, list[EntryPoint]] = {}
    for entry in entry_points(group=GROUP):
        declared.setdefault(entry.name, []).append(entry)
    return declared


def _owner(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


def _loaded(entry: EntryPoint) -> tuple[ChecksumKind, str]:
    text = f"{entry.name!r} of the package {_owner(entry)}"
    try:
        kind = entry.load()
        program = Path(str(sys.modules[entry.module].__file__)).read_bytes()
    except Exception as error:  # whatever the package does
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise ValueError(f"{text} cannot be loaded: {reason}") from None
    if not isinstance(kind, ChecksumKind):
        raise ValueError(f"{text}: expected a ChecksumKind, got a {type(kind).__name__}")
    return kind, sha256(program).hexdigest()
