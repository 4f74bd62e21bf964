"""Checksums: one row for each kind, ours and those that other packages add.

A row defines a kind completely. From it come the names that a deployment file may use, the JSON
schema, the table in docs/checksums.md, the check of received frames and the checksum of sent ones,
ours and those that can-gw of the kernel sends instead of us.
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
"""Group of the entry points of packages: the name of a kind, and its ``ChecksumKind``."""


@dataclass(frozen=True, slots=True)
class Checksum:
    """The checksum of one message of the deployment, with its position.

    Attributes:
        kind: name of its row in ``CHECKSUMS``.
        byte: first byte of the checksum.
        shift: lowest bit of the checksum in that byte: 4 in the upper half, else 0.
        order: byte order of a checksum of two bytes.
        can_id: identifier of the message. It does not enter ``==``, which compares one message in
            two deployments, never two messages.
    """

    kind: str
    byte: int
    shift: int = 0
    order: Literal["little", "big"] = "little"
    can_id: int = field(default=0, compare=False)

    def __reduce__(self) -> tuple[Callable[..., "Checksum"], tuple[object, ...]]:
        """Pickle the numbers from which the row is made, so that the reader can add the row.

        A reload binds the deployment in another process. That process may have added the row to its
        own ``CHECKSUMS``; the algorithm in the row is a function that cannot be pickled.
        """
        bound = (self.kind, self.byte, self.shift, self.order, self.can_id)
        return _handed_over, (_NUMBERS.get(self.kind), bound)

    def others(self, data: bytes) -> bytes:
        """Return the bytes of a frame that hold no bit of the checksum."""
        return data[: self.byte] + data[self.byte + (CHECKSUMS[self.kind].bits + 7) // 8 :]

    def verify(self, data: bytes) -> bool:
        """Return whether the checksum in a frame is right."""
        return self.protect(data, 0) == data

    def protect(self, data: bytes, count: int) -> bytes:
        """Return the frame with its checksum; ``count`` is unused, as the data hold the counter."""
        row, first, order = CHECKSUMS[self.kind], self.byte, self.order
        bits = row.bits
        size = (bits + 7) // 8
        before, after = data[:first], data[first + size :]
        rest = data[first] & 0xF0 >> self.shift if bits == 4 else 0  # the other half of the byte
        clear = before + rest.to_bytes(size, order) + after
        value = row.algorithm(self.can_id, self, clear) & (1 << bits) - 1
        return before + (value << self.shift | rest).to_bytes(size, order) + after


Algorithm = Callable[[int, Checksum, bytes], int]
"""Computes the checksum of a frame from CAN id, place of the checksum, and data.

The bits of the checksum are 0 in the data. As many low bits of the result count as the checksum
has. An algorithm runs in every tick: it waits for nothing, keeps nothing and raises nothing.
"""


@dataclass(frozen=True, slots=True)
class ChecksumKind:
    """A kind of checksum: its width, and the algorithm that computes it.

    Attributes:
        text: description for people.
        bits: width of the checksum: 4, 8 or 16.
        algorithm: computes the checksum. The kernel can compute an ``Xor`` or a ``Crc8`` too.
        needs_id: whether the CAN id enters the checksum, so that the file has to name the sender.

    Raises:
        ValueError: the width is another one, or is not 8 for an ``Xor`` or ``Crc8``.

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
        """The algorithm if can-gw of the kernel can compute it too; else None."""
        algorithm = self.algorithm
        return algorithm if isinstance(algorithm, Xor | Crc8) else None


CRC_WIDTHS: Mapping[int, type[CrcBase]] = {8: Crc8Base, 16: Crc16Base}
"""Widths (bits) that a CRC by its polynomial may have, with the crccheck class of each."""


def crc_kind(bits: int, polynomial: int, start: int, end: int, *, reflected: bool) -> str:
    """Add the CRC with these numbers to ``CHECKSUMS``, and return its name there.

    Args:
        bits: width, one of ``CRC_WIDTHS``.
        polynomial: polynomial without its highest bit.
        start: register before the first byte.
        end: value that is XORed into the register after the last byte.
        reflected: whether the lowest bit of each byte, and of the register, comes first.
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
    """Restore a pickled checksum; add its kind where only the other process has it."""
    if numbers is not None:
        crc_kind(*numbers[:4], reflected=numbers[4])
    elif bound[0] not in CHECKSUMS:
        known_checksum(bound[0])
    return Checksum(*bound)


def _of_others(crc: ReflectedCrc | Crc16) -> Algorithm:
    """Return the algorithm of a CRC over the bytes that hold no bit of the checksum."""
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
"""Every kind by its name, each over all bytes of a frame but its own. The kind of a package joins
the table when a deployment names it."""

_OURS = frozenset(CHECKSUMS)
_NUMBERS: dict[str, tuple[int, int, int, int, bool]] = {}
"""Arguments from which ``crc_kind`` made a row, by the name of the row."""
_SHA256: dict[str, str] = {}
"""SHA-256 of the module that added a kind, by kind."""


def known_checksum(kind: object) -> str:
    """Check the name of a kind, load its package into ``CHECKSUMS`` if it has one, and return it.

    Raises:
        ValueError: there is no such kind, or two have the name, or its package cannot be loaded.
            The message is one line for the person who wrote the deployment file.
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
    """Return the names of all kinds, ours first, without loading a package."""
    return list(dict.fromkeys([*(n for n in CHECKSUMS if n in _OURS), *_packages()]))


def package_line(kind: str) -> str | None:
    """Return a log line: package of a kind and its module's SHA-256; None for a kind of ours."""
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
