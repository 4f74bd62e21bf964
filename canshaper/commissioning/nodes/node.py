"""A node of CANopen by its EDS: its PDOs, each with identifier, mapping and timer (CiA 301)."""

from collections.abc import Iterator
from dataclasses import dataclass

from canopen.objectdictionary import ODArray, ODRecord, ODVariable, datatypes

from canshaper.codec.frame import service_of
from canshaper.commissioning.nodes.eds import Eds
from canshaper.errors import ConfigError, Problem

MOST_PDOS = 512
MOST_BITS = 64
RECEIVE, TRANSMIT = 0x1400, 0x1800  # communication parameters of the first RPDO and TPDO
MAPPING = 0x200  # from there to the mapping parameters
COB_ID, TRANSMISSION, EVENT_TIMER = 1, 2, 5  # subindices of the communication parameters
OFF_BIT, EXTENDED_BIT, ID_BITS = 1 << 31, 1 << 29, (1 << 29) - 1
_FIRST_OBJECT = 0x20  # below stand types; mapped they are a gap


@dataclass(frozen=True)
class Mapped:
    """An object in a PDO.

    Attributes:
        name: its ParameterName.
        parent: that of the array or record that it is in, or "".
        start: its first bit.
        bits: its length; 1 of a BOOLEAN, however long its entry is.
        low, high: LowLimit and HighLimit, None where the file has none.
    """

    name: str
    parent: str
    index: int
    subindex: int
    start: int
    bits: int
    signed: bool
    is_float: bool
    low: int | None
    high: int | None


@dataclass(frozen=True)
class Pdo:
    """A PDO with objects in it.

    Attributes:
        index: of its communication parameters.
        on: whether the node sends or takes it without a change of its parameters.
        can_id: its identifier.
        transmission: transmission type; None where the file has none.
        event_timer_ms: of a TPDO how often it is sent, of an RPDO how long it may stay away; 0 is
            off, None where the node has no such timer.
        objects: what is mapped, without gaps.
        bits: its length.
    """

    index: int
    on: bool
    can_id: int
    extended: bool
    transmission: int | None
    event_timer_ms: int | None
    objects: tuple[Mapped, ...]
    bits: int

    @property
    def transmitted(self) -> bool:
        """Whether the node sends it."""
        return self.index >= TRANSMIT

    @property
    def name(self) -> str:
        """Name such as TPDO1."""
        number = self.index - (TRANSMIT if self.transmitted else RECEIVE) + 1
        return f"{'T' if self.transmitted else 'R'}PDO{number}"


class Node:
    """A node of CANopen, as its file describes it.

    Args:
        eds: its file.
        node: its node id.

    Attributes:
        profile: number of its device profile, such as 401; 0 for none.
        pdos: those that can be used, RPDOs first.
        left_out: those without identifier or objects, and where that stands.
        faults: of those that cannot be used.

    Raises:
        ConfigError: there is no PDO that can be used.
    """

    def __init__(self, eds: Eds, node: int) -> None:
        self.eds, self.id = eds, node
        self.objects = eds.objects(node)
        self.profile = (self.value(0x1000, 0) or 0) & 0xFFFF
        self.left_out: list[str] = []
        self.faults: list[Problem] = []
        self.pdos = [*self._pdos(RECEIVE), *self._pdos(TRANSMIT)]
        if not self.pdos:
            why = ", ".join(self.left_out) or "none"
            text = f"expected a PDO with objects, got {why}; map some, and export the DCF"
            none = eds.problem("", text)
            raise ConfigError(self.faults or [none])

    def variable(self, index: int, subindex: int) -> ODVariable | None:
        """Return an object of the node; None where it has none there."""
        entry = self.objects.indices.get(index)
        if isinstance(entry, ODArray) and 0 < subindex <= self.eds.elements(index):
            entry = entry[subindex]  # like the first, where it has no name
        elif isinstance(entry, ODRecord | ODArray):
            entry = entry.subindices.get(subindex)
        elif subindex:
            return None
        return entry if isinstance(entry, ODVariable) else None

    def value(self, index: int, subindex: int) -> int | None:
        """Return the value of an object: ParameterValue of a DCF, else DefaultValue; None for none.

        Raises:
            ConfigError: it is no number.
        """
        variable = self.variable(index, subindex)
        if variable is None:
            return None
        for value, key in ((variable.value, "value_raw"), (variable.default, "default_raw")):
            raw = getattr(variable, key, None)
            if value is None and raw is not None and raw.strip():
                text = f"expected a whole number, got {raw!r}"
                raise ConfigError([self.eds.problem(_section(index, subindex), text)])
            if value is not None:
                return int(value)
        return None

    def _pdos(self, first: int) -> Iterator[Pdo]:
        for index in range(first, first + MOST_PDOS):
            try:
                if index in self.objects.indices and (pdo := self._pdo(index)):
                    yield pdo
            except ConfigError as error:
                self.faults += error.problems

    def _pdo(self, index: int) -> Pdo | None:
        """Return a PDO; None, and a note in ``left_out``, for one without identifier or objects."""
        cob_id, section = self.value(index, COB_ID) or 0, _section(index, COB_ID)
        count, can_id = self.value(index + MAPPING, 0), cob_id & ID_BITS
        name = f"{'T' if index >= TRANSMIT else 'R'}PDO{index % MAPPING + 1}"
        if not can_id and cob_id in (0, OFF_BIT):
            self.left_out.append(f"{name} without identifier ({_object(index, COB_ID)})")
            return None
        if not count:
            self.left_out.append(f"{name} empty ({_object(index + MAPPING, 0)})")
            return None
        extended = bool(cob_id & EXTENDED_BIT)
        if not extended and (can_id > 0x7FF or service_of(can_id)):
            got = f"{can_id:#x}" + (f", {service_of(can_id)}" if service_of(can_id) else "")
            text = f"expected the identifier of a PDO, got {got}"
            raise ConfigError([self.eds.problem(section, text)])
        objects, bits = self._mapped(index + MAPPING, count)
        timer = self.value(index, EVENT_TIMER)
        if timer is None and self.variable(index, EVENT_TIMER):
            timer = 0
        transmission = self.value(index, TRANSMISSION)
        on = not cob_id & OFF_BIT
        return Pdo(index, on, can_id, extended, transmission, timer, objects, bits)

    def _mapped(self, index: int, count: int) -> tuple[tuple[Mapped, ...], int]:
        """Return the objects of a PDO, and its length in bits."""
        if count > MOST_BITS:
            text = f"expected {MOST_BITS} objects at most, got {count}"
            raise ConfigError([self.eds.problem(_section(index, 0), text)])
        objects: list[Mapped] = []
        bits = 0
        for subindex in range(1, count + 1):
            entry, section = self.value(index, subindex), _section(index, subindex)
            if entry is None:
                text = f"expected object {subindex} of {count} that are mapped, got none"
                raise ConfigError([self.eds.problem(section, text)])
            mapped, length = self._entry(entry, bits, section)
            bits += length
            if bits > MOST_BITS:
                text = f"expected a mapping of 8 bytes at most, got {bits} bits"
                raise ConfigError([self.eds.problem(section, text)])
            objects += [mapped] if mapped else []
        return tuple(objects), bits

    def _entry(self, entry: int, start: int, section: str) -> tuple[Mapped | None, int]:
        """Return the object of a mapping entry, None for a gap; and its length."""
        index, subindex, length = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
        if not length or index < _FIRST_OBJECT:
            return None, length
        variable, parent = self.variable(index, subindex), self.objects.indices.get(index)
        if variable is None:
            text = f"expected an object of the file, got {_object(index, subindex)}"
            raise ConfigError([self.eds.problem(section, text)])
        kind = variable.data_type
        mapped = Mapped(
            variable.name,
            parent.name if isinstance(parent, ODRecord | ODArray) else "",
            index,
            subindex,
            start,
            1 if kind == datatypes.BOOLEAN else length,
            kind in datatypes.SIGNED_TYPES,
            kind in datatypes.FLOAT_TYPES,
            variable.min,
            variable.max,
        )
        if mapped.is_float and length != (32 if kind == datatypes.REAL32 else 64):
            text = f"expected the length of {variable.name}, got {length} bits"
            raise ConfigError([self.eds.problem(section, text)])
        return mapped, length


def _section(index: int, subindex: int) -> str:
    return f"{index:04X}sub{subindex:X}"


def _object(index: int, subindex: int) -> str:
    return f"{index:04X}h:{subindex}"
